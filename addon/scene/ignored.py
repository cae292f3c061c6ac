"""What a scene asks for that a render of ours does not give."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

GEOMETRY = {
    "MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL",
}  # fmt: skip
"""Types of objects that other engines draw. Lights alone are seen by nobody."""
OURS = ("use_pass_combined", "use_pass_z", "use_pass_cryptomatte_accurate")
"""Switches of view layers that ask for no pass that we lack; the second one is how Cryptomatte counts."""
NAMED = 3
"""Objects that a line names."""


def ignored(scene: bpy.types.Scene) -> tuple[str, ...]:
    """One readable line for each thing that the render ignores; none where nothing was solved.

    Motion blur, volumes and the world are not listed: nobody expects them of a filmed picture.
    """
    settings: bpy.types.PropertyGroup = scene.virtual_aperture
    if settings.points is None:
        return ()
    return tuple(
        line for lines in (_objects(scene), _camera(scene), _frames(scene), _passes(scene)) for line in lines
    )


def way_to_draw(scene: bpy.types.Scene) -> str:
    """Which objects are not drawn, and how they are to be drawn over the clip; nothing where there are none.
    Short: it stands over the picture."""
    names, rest = _left_out(scene)
    if not names:
        return ""
    return (
        f"Not drawn: {names}{rest}. To have CG objects over the clip, render them with Cycles in a new scene,"
        " a Linked Copy of this one, and lay them over it in the Compositor"
    )


def _objects(scene: bpy.types.Scene) -> Iterator[str]:
    names, rest = _left_out(scene)
    if names:
        yield f"CG objects are not rendered: {names}{rest}"


def _left_out(scene: bpy.types.Scene) -> tuple[str, str]:
    """The first names of the objects that are not drawn, and how many more there are."""
    names: list[str] = []
    for layer in scene.view_layers:
        if layer.use:
            # Of an object that was just removed from the file, None is left.
            there = [thing for thing in layer.objects if thing is not None]
            names += [o.name for o in there if o.name not in names and _is_drawn(o, layer, scene)]
    rest = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]), rest


def _is_drawn(thing: bpy.types.Object, layer: bpy.types.ViewLayer, scene: bpy.types.Scene) -> bool:
    """Whether the user sees a geometry object and another engine would draw it."""
    settings = scene.virtual_aperture
    if thing.type not in GEOMETRY or thing in (settings.points, settings.aperture):
        return False
    rendered = not thing.hide_render and any(not each.hide_render for each in thing.users_collection)
    return rendered and thing.visible_camera and thing.visible_get(view_layer=layer)


def _camera(scene: bpy.types.Scene) -> Iterator[str]:
    ours, camera = scene.virtual_aperture.camera, scene.camera
    if camera is not None and ours is not None and camera != ours:
        yield f"The render shows the clip through its own camera, not through {camera.name}"
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        yield f"Depth of Field of {camera.name} is ignored; Focus and Lens are used instead"


def _frames(scene: bpy.types.Scene) -> Iterator[str]:
    first, last = scene.virtual_aperture.clip_first, scene.virtual_aperture.clip_last
    # What older versions built does not know.
    if last < 1:
        return
    if scene.frame_start < first:
        yield f"Frames {scene.frame_start} to {first - 1} come before the clip and repeat its frame {first}"
    if scene.frame_end > last:
        yield f"Frames {last + 1} to {scene.frame_end} come after the clip and repeat its frame {last}"


def _passes(scene: bpy.types.Scene) -> Iterator[str]:
    names: list[str] = []
    for layer in scene.view_layers:
        if layer.use:
            switches = [p for p in layer.bl_rna.properties if p.identifier.startswith("use_pass_")]
            names += [p.name for p in switches if p.identifier not in OURS and getattr(layer, p.identifier)]
            names += [aov.name for aov in layer.aovs]
    if names:
        yield f"These passes are not rendered: {', '.join(dict.fromkeys(names))}"


def warn_of_ignored(engine: bpy.types.RenderEngine, scene: bpy.types.Scene) -> None:
    """A render's warnings of what it ignores: of an animation, on its first frame only."""
    if not engine.is_animation or scene.frame_current == scene.frame_start:
        for line in ignored(scene):
            engine.report({"WARNING"}, line)
