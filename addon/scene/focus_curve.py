"""The F-curve of the focus distance that focus marks write, and what the user does to it.

Keys at marks are of the type Keyframe, those between, of what is followed or eased, of the type Generated, or
Jitter at frames that do not show what is followed: the dope sheet has a colour for each. A mark's key that
the user moves or deletes moves or deletes the mark; a curve edited in another way is the user's from then on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.focus.pull import FocusMark, pull
from . import lens
from .shot import reconstruction_of

WRITTEN = "written_keys"
"""Custom property of the marks: frames and values of the keys, one after the other, as they were written."""
GROUP = "Focus"
"""Of the F-curve, in the dope sheet."""


@dataclass(frozen=True)
class Keys:
    """The keys of a curve."""

    places: NDArray[np.float32]
    """(n, 2) frames and values."""
    of_marks: NDArray[np.bool_]
    """(n,) which are of a mark."""


@dataclass(frozen=True)
class Edit:
    """What the user did to the keys of marks."""

    moved: dict[int, tuple[int, float | None]]
    """By frame of a mark the frame that it goes to, and the distance that it was given, if it was."""
    removed: tuple[int, ...]
    """Frames of marks whose keys are gone."""
    added: dict[int, float]
    """Distances that were keyed, by frame."""


def write(
    settings: bpy.types.PropertyGroup, marks: Sequence[FocusMark], unseen: Sequence[int]
) -> dict[int, float]:
    """Make the curve of marks, in place of the one that is there; the distances by frame. At frames `unseen`
    a mark is carried that they do not show."""
    own = {mark.frame for mark in marks}
    frames = sorted(own | set(range(settings.clip_first, settings.clip_last + 1)))
    distances = pull(marks, reconstruction_of(settings), frames)
    curve = _made(settings)
    keys = curve.keyframe_points
    keys.clear()
    keys.add(len(frames))
    places = np.array(list(distances.items()), np.float32)
    keys.foreach_set("co", places.ravel())
    kinds = _kinds()
    hidden = set(unseen)
    names = ["KEYFRAME" if f in own else "JITTER" if f in hidden else "GENERATED" for f in frames]
    keys.foreach_set("type", np.array([kinds[name] for name in names], np.int32))
    # Linear between frames.
    keys.foreach_set("interpolation", np.ones(len(frames), np.int32))
    # New ones are selected: where one is dragged onto another selected one, Blender keeps their mean.
    for part in ("control_point", "left_handle", "right_handle"):
        keys.foreach_set(f"select_{part}", np.zeros(len(frames), dtype=bool))
    curve.update()
    if WRITTEN in settings.marks:
        # Blender 5.2 writes an array over one of another length in place, past its end.
        del settings.marks[WRITTEN]
    settings.marks[WRITTEN] = places.astype(np.float64).ravel()
    settings.marks.written = _digest(_keys(curve))
    return distances


def value(settings: bpy.types.PropertyGroup, frame: int) -> float:
    """The distance at a frame, of the curve that is there."""
    curve = lens.keys_of(settings, "focus_distance")
    assert curve is not None
    return float(curve.evaluate(frame))


def remove(settings: bpy.types.PropertyGroup) -> None:
    """Remove the curve that marks wrote, if there is one; its action goes with its last curve."""
    curve = lens.keys_of(settings, "focus_distance")
    settings.marks.written = ""
    if WRITTEN in settings.marks:
        del settings.marks[WRITTEN]
    if curve is None:
        return
    shown = settings.focus_distance
    bag = lens.channels_of(settings)
    assert bag is not None
    bag.fcurves.remove(curve)
    with lens.writing():
        settings.focus_distance = shown


def is_as_written(settings: bpy.types.PropertyGroup) -> bool:
    """Whether the keys are those that the marks wrote; also where neither has any."""
    curve = lens.keys_of(settings, "focus_distance")
    if curve is None:
        return not settings.marks.written
    return bool(_digest(_keys(curve)) == settings.marks.written)


def edit_of(settings: bpy.types.PropertyGroup) -> Edit | None:
    """What was done to the keys of marks since they were written; None where the curve was edited in another
    way, and is the user's."""
    curve = lens.keys_of(settings, "focus_distance")
    own = {mark.frame for mark in settings.marks.items}
    if curve is None:
        return Edit({}, tuple(own), {})
    then, now = np.array(settings.marks[WRITTEN], np.float32).reshape(-1, 2), _keys(curve)
    was_mark = np.isin(then[:, 0], list(own))
    before = {int(frame): float(at) for frame, at in then[was_mark]}
    after = [(float(frame), float(at)) for frame, at in now.places[now.of_marks]]
    found = _matched(before, after)
    if found.moved or found.removed or found.added:
        return found
    # A distance keyed between marks takes the place of a generated key.
    ours, theirs = then[~was_mark], now.places[~now.of_marks]
    if ours.shape == theirs.shape and (ours[:, 0] == theirs[:, 0]).all():
        other = np.flatnonzero(ours[:, 1] != theirs[:, 1])
        if len(other) == 1:
            frame, at = theirs[other[0]]
            return Edit({}, (), {int(frame): float(at)})
    return None


def accept(settings: bpy.types.PropertyGroup) -> None:
    """What the curve is now is what was written."""
    curve = lens.keys_of(settings, "focus_distance")
    settings.marks.written = "" if curve is None else _digest(_keys(curve))


def _matched(before: dict[int, float], after: list[tuple[float, float]]) -> Edit:
    """Which of the keys (frame, value) are which of those that were, by frame."""
    left = [key for key in after if before.get(round(key[0])) != key[1] or key[0] != round(key[0])]
    gone = [frame for frame, at in before.items() if (float(frame), at) not in after]
    moved: dict[int, tuple[int, float | None]] = {}
    # By value, then by frame, then in order.
    for alike in (
        lambda frame, key: before[frame] == key[1],
        lambda frame, key: frame == round(key[0]),
        lambda frame, key: len(gone) == len(left),
    ):
        for frame in tuple(gone):
            key = next((key for key in left if alike(frame, key)), None)
            if key is not None:
                moved[frame] = (round(key[0]), None if key[1] == before[frame] else key[1])
                gone.remove(frame)
                left.remove(key)
    return Edit(moved, tuple(gone), {round(frame): at for frame, at in left})


def _made(settings: bpy.types.PropertyGroup) -> bpy.types.FCurve:
    """The curve of the focus distance, made where there is none."""
    if lens.keys_of(settings, "focus_distance") is None:
        scene = settings.id_data
        scene.keyframe_insert(settings.path_from_id("focus_distance"), group=GROUP)
    curve = lens.keys_of(settings, "focus_distance")
    assert curve is not None
    return curve


def _keys(curve: bpy.types.FCurve) -> Keys:
    points = curve.keyframe_points
    places = np.zeros((len(points), 2), np.float32)
    types = np.zeros(len(points), np.int32)
    points.foreach_get("co", places.ravel())
    points.foreach_get("type", types)
    kinds = _kinds()
    return Keys(places, ~np.isin(types, [kinds["GENERATED"], kinds["JITTER"]]))


def _kinds() -> dict[str, int]:
    kinds = bpy.types.Keyframe.bl_rna.properties["type"].enum_items
    return {kind.identifier: kind.value for kind in kinds}


def _digest(keys: Keys) -> str:
    return hashlib.sha256(keys.places.tobytes() + keys.of_marks.tobytes()).hexdigest()[:16]
