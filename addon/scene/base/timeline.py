"""The clip's frame that a scene shows, and the scene's frame that shows a frame of the clip.

They have the same number, unless the scene has *Time Remapping* or stands between two frames. Blender
evaluates animation at the remapped time; the clip has whole frames only, and one is shown until the next
begins.
"""

import math

import bpy

from ...core.base.errors import UserError
from ...core.media.clip import Footage
from ...core.media.sequence import LAST_FRAME

ROUNDING = 1e-3
"""Frames by which Blender may miss a whole number: its old and new lengths are at most 900."""
PRECISION = 2.5e-7
"""Relative error of remapped frames: Blender multiplies them in single precision."""


def clip_frame(scene: bpy.types.Scene, at: int | None = None) -> int:
    """Return the frame that the scene shows now, or at its frame `at`."""
    render = scene.render
    exact = scene.frame_current_final if at is None else at * render.frame_map_old / render.frame_map_new
    nearest = round(exact)
    is_whole = abs(exact - nearest) < ROUNDING + PRECISION * abs(exact)
    return int(nearest if is_whole else math.floor(exact))


def scene_time(scene: bpy.types.Scene, frame: int) -> tuple[int, float]:
    """Return the scene's frame and subframe that show the beginning of a frame of the clip."""
    render = scene.render
    exact = frame * render.frame_map_new / render.frame_map_old
    return math.floor(exact), exact - math.floor(exact)


def go_to(scene: bpy.types.Scene, frame: int) -> None:
    """Have the scene show a frame of the clip; UserError if Blender has no such frame."""
    whole, subframe = scene_time(scene, frame)
    scene.frame_set(whole, subframe=subframe)
    if clip_frame(scene) != frame:
        raise UserError(_beyond(frame))


def check_frames(footage: Footage) -> None:
    """Refuse a clip with frames that Blender does not have, by a UserError."""
    if footage.frames[-1] > LAST_FRAME:
        raise UserError(f"{footage.path.name}: {_beyond(footage.frames[-1])}")


def _beyond(frame: int) -> str:
    return (
        f"frame {frame} is beyond Blender's last frame, {LAST_FRAME}; number the clip's pictures from 1, or"
        " cut the clip"
    )
