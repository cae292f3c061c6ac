"""Settings of a scene that our renders ignore."""

import math
from collections.abc import Iterator

import bpy

from ..core.media.clip import describe
from .base.timeline import ROUNDING, clip_frame, scene_time
from .edited_camera import edits
from .sources.shot import Shot

OURS = ("use_pass_combined", "use_pass_z", "use_pass_cryptomatte_accurate")
"""Switches of view layers that ask for no pass that we lack; the second one is how Cryptomatte counts."""


def ignored(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Return a line for each setting that the render ignores; none without a solve.

    The world behind the clip is not listed: nobody expects it of a filmed picture.
    """
    settings: bpy.types.PropertyGroup = scene.virtual_aperture
    if settings.points is None:
        return ()
    return (*unseen(scene), *_frames(scene), *_movie(scene))


def unseen(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Return one readable line for each thing that no picture of the scene shows, whatever is rendered."""
    return (*_camera(scene), *_passes(scene))


def _camera(scene: bpy.types.Scene) -> Iterator[str]:
    ours, camera = scene.virtual_aperture.camera, scene.camera
    if camera is not None and ours is not None and camera != ours:
        yield f"The render shows the clip through its own camera, not through {camera.name}"
    if edited := edits(scene):
        yield f"These changes of the clip's camera are ignored: {', '.join(edited)}"
    if camera is not None and camera.type == "CAMERA" and camera.data.dof.use_dof:
        yield f"Depth of Field of {camera.name} is ignored; Focus and Lens are used instead"
    if scene.render.use_multiview:
        yield "Stereoscopy is ignored: every view shows the clip as it is"


def _frames(scene: bpy.types.Scene) -> Iterator[str]:
    first, last = scene.virtual_aperture.clip_first, scene.virtual_aperture.clip_last
    if clip_frame(scene, scene.frame_start) < first:
        before = math.ceil(_time(scene, first)) - 1
        yield _outside(scene.frame_start, before, "before", first)
    if clip_frame(scene, scene.frame_end) > last:
        after = math.ceil(_time(scene, last + 1))
        yield _outside(after, scene.frame_end, "after", last)


def stand_in(scene: bpy.types.Scene, shot: Shot) -> str:
    """Return why the frame shows another frame of the clip; empty where it shows its own."""
    frames, render = shot.footage.frames, scene.render
    asked, exact = clip_frame(scene), scene.frame_current_final
    shown = shot.frame_at(asked)
    if not frames[0] <= asked <= frames[-1]:
        where = "before" if asked < frames[0] else "after"
        return f"comes {where} the clip, which has {describe(frames)}, and repeats its frame {shown}"
    if shown != asked:
        return f"is missing in the clip, and repeats its frame {shown}"
    is_between = abs(exact - asked) > ROUNDING and render.frame_map_old == render.frame_map_new
    return f"is asked for at {exact:.2f}; there are no pictures between frames" if is_between else ""


def _outside(start: int, end: int, where: str, shown: int) -> str:
    if start == end:
        return f"Frame {start} comes {where} the clip and repeats its frame {shown}"
    return f"Frames {start} to {end} come {where} the clip and repeat its frame {shown}"


def _time(scene: bpy.types.Scene, frame: int) -> float:
    return sum(scene_time(scene, frame))


def _movie(scene: bpy.types.Scene) -> Iterator[str]:
    if scene.virtual_aperture.render_as != "MOVIE":
        return
    if scene.render.frame_map_old != scene.render.frame_map_new:
        yield "Render Clip makes movies without Time Remapping; Render As: Frames uses it"
    if scene.frame_step > 1:
        yield "Render Clip makes movies of every frame, whatever Step is; Render As: Frames uses it"


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
    """Warn of ignored settings in a render; in an animation, on its first frame only."""
    if not engine.is_animation or scene.frame_current == scene.frame_start:
        for line in ignored(scene):
            engine.report({"WARNING"}, line)
