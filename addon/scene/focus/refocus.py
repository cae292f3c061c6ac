"""The focus of a scene, kept over a new solve of the same clip."""

from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.focus.focus import Focus
from ...core.focus.pull import FocusMark
from ...core.focus.transfer import carry_focus, carry_place
from ...core.media.find_clip import is_clip
from ..lens import lens
from ..sources.shot import reconstruction_of
from . import focus_marks
from .kept_places import marks_of

LENGTHS = ("focus_distance", "aperture_radius")
"""Properties of the lens in scene units, which are other ones after a new solve."""


@dataclass(frozen=True)
class KeptFocus:
    """The lens settings in terms of the old reconstruction."""

    reconstruction: Reconstruction
    focus: Focus
    frame: int
    by: str
    radius: float
    """0 while the blur has not chosen it."""
    metres_per_unit: float
    """0 where it is not known."""
    marks: tuple[FocusMark, ...] = ()
    is_first: bool = False
    """True if the focus was not picked by the user."""


def keep_focus(settings: bpy.types.PropertyGroup, clip: Path) -> KeptFocus | None:
    """Return the scene's focus and scale; None without any, or if its solve is of another clip."""
    if settings.points is None or not is_clip(clip, settings.clip_identity):
        return None
    focus = Focus(
        tuple(entry.point for entry in settings.focus_points),
        settings.focus_distance if settings.focus_distance > 0 else None,
        settings.focus_through_points,
    )
    scale = settings.metres_per_unit
    if not focus.points and focus.distance is None and not scale:
        return None
    radius = settings.aperture_radius
    marks = marks_of(settings) if focus_marks.say_the_focus(settings) else []
    try:
        old = reconstruction_of(settings)
    except UserError:
        return None
    return KeptFocus(
        old, focus, settings.focus_frame, settings.focus_by, radius, scale,
        tuple(marks), settings.marks.is_first,
    )  # fmt: skip


def restore_focus(settings: bpy.types.PropertyGroup, kept: KeptFocus, new: Reconstruction) -> str:
    """Put the kept focus into a scene whose clip was solved again; returns a note for the user, or "".

    Keys of the distance and of the aperture are brought to the new scale, too.
    """
    carried = carry_focus(kept.reconstruction, new, kept.focus, kept.frame)
    with lens.writing():
        settings.focus_points.clear()
        for point in carried.focus.points:
            settings.focus_points.add().point = point
        settings.focus_frame = carried.frame
        settings.focus_distance = carried.focus.distance or 0.0
        has_points = bool(carried.focus.points)
        settings.focus_by = kept.by if has_points or not settings.focus_distance else "DISTANCE"
        settings.aperture_radius = kept.radius * carried.scale
    settings.metres_per_unit = kept.metres_per_unit / carried.scale
    for name in LENGTHS:
        _scale_keys(lens.keys_of(settings, name), carried.scale)
    if kept.marks:
        carried_marks = [
            replace(mark, places=tuple(carry_place(kept.reconstruction, new, place) for place in mark.places))
            for mark in kept.marks
        ]
        focus_marks.replace_all(settings, carried_marks)
        settings.marks.is_first = kept.is_first
    if has_points or kept.by != "POINTS" or not kept.focus.points:
        return ""
    if settings.focus_distance:
        return "The points in focus were not found again; focus stays at their distance. Pick it again"
    return "The points in focus were not found again. Pick the focus again"


def _scale_keys(curve: bpy.types.FCurve | None, scale: float) -> None:
    if curve is None:
        return
    for key in curve.keyframe_points:
        # Assigning the key's own value would move its handles along.
        left, right = key.handle_left[1] * scale, key.handle_right[1] * scale
        key.co[1] *= scale
        key.handle_left[1], key.handle_right[1] = left, right
    curve.update()
