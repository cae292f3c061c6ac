"""Renders by Blender's command line: `blender -b FILE -a` ends with status 1 if a frame fails.

Blender itself ends with status 0 after an engine's error, and does not check its output. Farms rely on the
status.
"""

import os
import sys
from pathlib import Path
from typing import NoReturn

import bpy

from ...scene.base.events import at
from .. import engine
from ..views.frame_size import written_size
from . import frame_files

COMMANDS = {"-a", "--render-anim", "-f", "--render-frame"}
FORMATS = {"PNG", "OPEN_EXR"}
"""File formats that are read back after they were written."""


def _is_ours(scene: bpy.types.Scene) -> bool:
    """Return whether this Blender's command line asked for a render, and it is by our engine."""
    asked = bpy.app.background and bpy.app.binary_path and COMMANDS & set(sys.argv)
    return bool(asked) and scene.render.engine == engine.VirtualApertureEngine.bl_idname


@at("render_write")
def _on_write(scene: bpy.types.Scene, _: object = None) -> None:
    if not _is_ours(scene) or scene.render.image_settings.file_format not in FORMATS:
        return
    for path, size in written_files(scene).items():
        if problem := frame_files.still_problem(path, size):
            path.unlink(missing_ok=True)
            cause = frame_files.likely_cause(problem)
            _end(f"frame {scene.frame_current}: {path} {problem} and was discarded{cause}")


def written_files(scene: bpy.types.Scene) -> dict[Path, tuple[int, int] | None]:
    """Return the pictures that Blender writes of the present frame, and their sizes (width, height).

    With stereoscopy each view has a file, or all share one, whose size is that of their arrangement: None.
    """
    render, frame = scene.render, scene.frame_current
    if not render.use_multiview:
        return {Path(render.frame_path(frame=frame)): written_size(render)}
    if render.image_settings.views_format != "INDIVIDUAL":
        return {Path(render.frame_path(frame=frame)): None}
    views = render.stereo_views if render.views_format == "STEREO_3D" else render.views
    names = [view.name for view in views if view.use]
    return {Path(render.frame_path(frame=frame, view=name)): written_size(render) for name in names}


@at("render_cancel")
def _on_cancel(scene: bpy.types.Scene, _: object = None) -> None:
    if _is_ours(scene):
        _end("rendering was stopped by an error or a signal; the frames written before that are complete")


def _end(text: str) -> NoReturn:
    print(f"error: {text}", file=sys.stderr, flush=True)
    sys.stdout.flush()
    # Blender would go on with its next argument, and end with status 0.
    os._exit(1)
