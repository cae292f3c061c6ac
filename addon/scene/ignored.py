"""What a scene asks for that a render of ours does not give."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

OURS = ("use_pass_combined", "use_pass_z", "use_pass_cryptomatte_accurate")
"""Switches of view layers that ask for no pass that we lack; the second one is how Cryptomatte counts."""


def ignored(scene: bpy.types.Scene) -> tuple[str, ...]:
    """One readable line for each thing that the render ignores; none where nothing was solved.

    The world behind the clip is not listed: nobody expects it of a filmed picture.
    """
    settings: bpy.types.PropertyGroup = scene.virtual_aperture
    if settings.points is None:
        return ()
    return tuple(line for lines in (_camera(scene), _frames(scene), _passes(scene)) for line in lines)


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
