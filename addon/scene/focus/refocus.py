"""The focus of a scene, kept over a new solve of the same clip."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.focus.focus import Focus
from ...core.focus.pull import FocusMark
from ...core.focus.transfer import carry_focus, carry_place
from ...core.media.clip_identity import is_clip
from ..lens import lens
from ..sources.shot import reconstruction_of
from . import focus_marks

LENGTHS = ("focus_distance", "aperture_radius")
"""Properties of the lens in scene units, which are other ones after a new solve."""


@dataclass(frozen=True)
class KeptFocus:
    """The lens settings in terms of the old reconstruction."""

    reconstruction: Reconstruction
    marks: tuple[FocusMark, ...]
    distance: float
    """0 without a focus."""
    radius: float
    """0 while the blur is stored."""
    f_stop: float
    """0 unless the aperture was set by it."""
    metres_per_unit: float
    """0 where it is not known."""
    guessed_scale: float
    """The same by people in the clip."""


def keep_focus(settings: bpy.types.PropertyGroup, clip: Path) -> KeptFocus | None:
    """Return the scene's focus and scale; None without any, or if its solve is of another clip."""
    if settings.points is None or not is_clip(clip, settings.clip_identity):
        return None
    marks = () if focus_marks.are_keys_gone(settings) else tuple(focus_marks.marks_of(settings))
    distance, radius = settings.focus_distance, lens.stored(settings, "aperture_radius")
    scales = settings.metres_per_unit, settings.guessed_scale
    if not (marks or distance or radius or any(scales)):
        return None
    try:
        old = reconstruction_of(settings)
    except UserError:
        return None
    stop = settings.f_stop if settings.by_f_stop else 0.0
    return KeptFocus(old, marks, distance, radius, stop, *scales)


def restore_focus(settings: bpy.types.PropertyGroup, kept: KeptFocus, new: Reconstruction) -> str:
    """Put the kept focus into a scene whose clip was solved again; returns a note for the user, or "".

    Keys of the distance and of the aperture are brought to the new scale, too.
    """
    old, frame = kept.reconstruction, kept.marks[0].frame if kept.marks else int(new.frames[0])
    scale = carry_focus(old, new, Focus(), frame).scale
    settings.focus_distance = kept.distance * scale
    if kept.radius > 0:
        settings.aperture_radius = kept.radius * scale
    settings.metres_per_unit = kept.metres_per_unit / scale
    settings.guessed_scale = kept.guessed_scale / scale
    settings.f_stop = kept.f_stop
    for name in LENGTHS:
        _scale_keys(lens.keys_of(settings, name), scale)
    carried = [
        replace(mark, places=tuple(carry_place(old, new, place) for place in mark.places))
        for mark in kept.marks
    ]
    focus_marks.replace_all(settings, carried)
    if _by_points(carried) == _by_points(kept.marks):
        return ""
    return "The points in focus were not found again; focus stays at their distance. Pick it again"


def _by_points(marks: Sequence[FocusMark]) -> int:
    """Number of the places that are followed by points."""
    return sum(bool(place.focus.points) for mark in marks for place in mark.places)


def _scale_keys(curve: bpy.types.FCurve | None, scale: float) -> None:
    if curve is None:
        return
    for key in curve.keyframe_points:
        # Assigning the key's own value would move its handles along.
        left, right = key.handle_left[1] * scale, key.handle_right[1] * scale
        key.co[1] *= scale
        key.handle_left[1], key.handle_right[1] = left, right
    curve.update()
