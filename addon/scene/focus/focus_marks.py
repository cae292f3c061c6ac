"""Focus marks: the user's focus at frames.

One mark gives a constant focus. A distance that changes over the clip is written as one F-curve of the focus
distance (`focus_curve.py`); feature points alone are followed without keys.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.depth.sparse import point_inverse_depths
from ...core.focus.focus import Focus
from ...core.focus.place import Place, first_place
from ...core.focus.pull import EASINGS, FocusMark, unseen
from ..base.option_properties import hidden
from ..base.timeline import clip_frame
from ..lens import aperture_cloud, lens
from ..sources.shot import reconstruction_of
from . import focus_curve
from .kept_marks import at_distance, name_of, packed, unpacked

NEARER = 3.0
"""Times that the first focus may come nearer before it stays at its distance instead. In a clip of a
restaurant the camera passes its points: at their distance, discs of all else are as wide as a quarter of the
picture."""


class VirtualApertureFocusMark(bpy.types.PropertyGroup):
    """The focus at a frame; `name` is the source of its distance.

    The mark is stored in `kept`; frame, easing, pull and hold are views of it.
    """

    frame: IntProperty(
        name="Frame",
        description="Frame at which this is in focus",
        get=lambda mark: mark.value.frame,
        set=lambda mark, frame: _edit(mark, frame=_free(mark, frame)),
    )
    easing: EnumProperty(
        name="Easing",
        description="How focus moves to this mark from the previous one",
        items=[
            ("SMOOTH", "Smooth", "Starts and arrives slowly", "IPO_EASE_IN_OUT", 0),
            ("LINEAR", "Linear", "Blur changes at a constant rate", "IPO_LINEAR", 1),
            ("EASE_IN", "Ease In", "Starts slowly and arrives at full speed", "IPO_EASE_IN", 2),
            ("EASE_OUT", "Ease Out", "Starts at full speed and arrives slowly", "IPO_EASE_OUT", 3),
            ("CUT", "Cut", "Stays on the previous mark up to this one", "IPO_CONSTANT", 4),
        ],
        get=lambda mark: list(EASINGS).index(mark.value.easing),
        set=lambda mark, number: _edit(mark, easing=list(EASINGS)[number]),
    )
    pull: IntProperty(
        name="Pull Over",
        description="Frames before this mark in which focus moves to it; until then it stays on the previous"
        " one. 0 takes all frames between the two",
        min=0,
        get=lambda mark: mark.value.pull,
        set=lambda mark, frames: _edit(mark, pull=frames),
    )
    holds: BoolProperty(
        name="Hold Distance",
        description="Keep the distance at the mark's frame instead of following what was picked",
        get=lambda mark: mark.value.holds,
        set=lambda mark, holds: _edit(mark, holds=holds),
    )
    kept: hidden(StringProperty, "Mark", "The mark, in JSON")
    distance: FloatProperty(
        name="Distance",
        description="Distance from the camera at its frame, in scene units",
        subtype="DISTANCE",
    )

    @property
    def value(self) -> FocusMark:
        """The mark as the core sees it."""
        return replace(unpacked(self.kept), name=self.name)

    @property
    def places(self) -> tuple[Place, ...]:
        """The places in focus."""
        return unpacked(self.kept).places

    def fill(self, value: FocusMark) -> None:
        """Store a mark, whose distance is that of its places."""
        with np.errstate(divide="ignore"):
            self.distance = 1 / np.mean(np.divide(1, [place.distance for place in value.places]))
        self.name = value.name or name_of(value.places)
        self.kept = packed(value)


class VirtualApertureFocusMarks(bpy.types.PropertyGroup):
    """The list of focus marks, in the order of their frames."""

    items: CollectionProperty(type=VirtualApertureFocusMark)
    suggested: CollectionProperty(type=VirtualApertureFocusMark)
    active: IntProperty(name="Active Focus Mark", options={"HIDDEN"})
    written: hidden(
        StringProperty, "Written", "Digest of the keyframes written by the marks; empty if there are none"
    )
    unseen: hidden(StringProperty, "Not Seen", "Frames in which the thing in focus cannot be seen")

    @property
    def is_first(self) -> bool:
        """Whether the focus is the automatic one, which nobody has picked yet."""
        return len(self.items) == 1 and all(place.is_automatic for place in self.items[0].places)

    @property
    def points(self) -> tuple[int, ...]:
        """The feature points of an only mark, which are followed without keys; of another focus none."""
        if len(self.items) != 1 or self.items[0].holds:
            return ()
        places = self.items[0].places
        if not all(place.focus.points for place in places):
            return ()
        return tuple(dict.fromkeys(point for place in places for point in place.focus.points))


def marks_of(settings: bpy.types.PropertyGroup) -> list[FocusMark]:
    """Return the marks as the core sees them."""
    return [mark.value for mark in settings.marks.items]


def replace_all(
    settings: bpy.types.PropertyGroup, marks: Iterable[FocusMark], active: int | None = None
) -> None:
    """Have these marks and no others, and write the focus.

    The mark at frame `active` becomes the active one, by default the one at the frame of the one before.
    """
    group, items = settings.marks, settings.marks.items
    if active is None and group.active < len(items):
        active = items[group.active].frame
    order = sorted(marks, key=lambda mark: mark.frame)
    for _ in range(len(items) - len(order)):
        items.remove(len(items) - 1)
    for number, mark in enumerate(order):
        (items[number] if number < len(items) else items.add()).fill(mark)
    group.active = 0
    activate(group, active)
    write(settings)


def activate(group: bpy.types.PropertyGroup, frame: int | None) -> None:
    """Make the mark at a frame the active one, if one is there."""
    group.active = next((n for n, mark in enumerate(group.items) if mark.frame == frame), group.active)


def put(
    settings: bpy.types.PropertyGroup, frame: int, places: Sequence[Place], add: bool = False
) -> bpy.types.PropertyGroup:
    """Put places in focus at a frame, and write the focus; the mark.

    The one mark that there is gives way, unless one is to be added; of several the one at this frame does.
    """
    marks = {mark.frame: mark for mark in marks_of(settings)}
    # Keys that the user deleted do not come back.
    if are_keys_gone(settings) or (not add and len(marks) < 2):
        marks = {}
    marks[frame] = replace(marks.get(frame, FocusMark(frame, ())), places=tuple(places), name="")
    settings.focus_through_points = any(place.focus.through_points for place in places)
    replace_all(settings, marks.values(), frame)
    return at_frame(settings, frame)


def set_focus(settings: bpy.types.PropertyGroup, focus: Focus, frame: int) -> None:
    """Put points or a distance in focus by a single mark, with its tilt."""
    distance = focus.distance or lens.distance_at(settings, focus, frame)
    settings.focus_tilt, settings.focus_swing = focus.tilt, focus.swing
    settings.focus_through_points = focus.through_points
    replace_all(settings, [FocusMark.of(Place(focus, frame, distance, "points or a distance"))])


def at_frame(settings: bpy.types.PropertyGroup, frame: int) -> bpy.types.PropertyGroup | None:
    """Return the mark at a frame."""
    return next((mark for mark in settings.marks.items if mark.frame == frame), None)


def have_distance(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the focus distance is that of the marks or of keys, and not one that was set by hand."""
    marks, distance = settings.marks.items, settings.focus_distance
    if len(marks) > 1 or not distance > 0 or lens.has_keys(settings, "focus_distance"):
        return True
    return len(marks) == 1 and marks[0].distance == distance


def take_distance(settings: bpy.types.PropertyGroup) -> None:
    """Put a distance that was set by hand in the place of the only mark, or make one at this frame."""
    (mark,) = marks_of(settings) or [FocusMark(clip_frame(settings.id_data), ())]
    place = at_distance(settings.focus_distance, mark.frame)
    replace_all(settings, [replace(mark, places=(place,), name="")])


def move(settings: bpy.types.PropertyGroup, index: int, frame: int) -> None:
    """Move a mark to a frame; UserError where another one is."""
    mark, other = settings.marks.items[index], at_frame(settings, frame)
    if other is not None and other != mark:
        raise UserError(f"frame {frame} already has a focus mark; remove that one first")
    _edit(mark, frame=frame)


def remove(settings: bpy.types.PropertyGroup, index: int) -> None:
    """Take a mark away; without any the focus stays at its distance, without keys."""
    marks = marks_of(settings)
    del marks[index]
    replace_all(settings, marks, marks[min(settings.marks.active, len(marks) - 1)].frame if marks else None)


def clear(settings: bpy.types.PropertyGroup) -> None:
    """Remove the marks and their keys, and the suggestions; the caller sets the focus."""
    settings.marks.suggested.clear()
    replace_all(settings, [])


def suggest(settings: bpy.types.PropertyGroup, marks: Iterable[FocusMark]) -> None:
    """Replace the suggested marks, which are not in focus until they are taken."""
    settings.marks.suggested.clear()
    for mark in marks:
        settings.marks.suggested.add().fill(mark)


def take(settings: bpy.types.PropertyGroup, frames: Sequence[int]) -> None:
    """Make the suggestions at frames marks, but where there are marks; write the focus."""
    group = settings.marks
    taken = {each.frame: replace(each.value, name="") for each in group.suggested if each.frame in frames}
    own = {} if group.is_first else {mark.frame: mark for mark in marks_of(settings)}
    suggest(settings, [each.value for each in group.suggested if each.frame not in frames])
    replace_all(settings, (taken | own).values(), frames[0])


def are_keys_users(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the focus distance has keys that no marks wrote, or that the user has edited since."""
    return lens.has_keys(settings, "focus_distance") and focus_curve.is_users(settings)


def are_keys_gone(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the user has deleted the keys that marks wrote."""
    return focus_curve.is_users(settings) and not lens.has_keys(settings, "focus_distance")


def take_keys_over(settings: bpy.types.PropertyGroup) -> None:
    """Write the focus in place of keys of the user's."""
    focus_curve.remove(settings)
    write(settings)


def write(settings: bpy.types.PropertyGroup) -> None:
    """Set the focus of the marks, by keys where its distance changes; the user's keys stay."""
    if are_keys_users(settings):
        return
    marks = marks_of(settings)
    frames = range(settings.clip_first, settings.clip_last + 1)
    hidden = unseen(marks, reconstruction_of(settings), frames) if marks else []
    settings.marks.unseen = " ".join(map(str, hidden))
    if not marks:
        focus_curve.remove(settings)
        aperture_cloud.update(settings)
        return
    steady = _steady(settings, marks)
    if steady is not None:
        focus_curve.remove(settings)
        settings.marks.items[0].distance = steady
        settings.focus_distance = steady
        return
    focus_curve.write(settings, marks, hidden)
    for mark in settings.marks.items:
        mark.distance = focus_curve.value(settings, mark.frame)
    settings.focus_distance = focus_curve.value(settings, clip_frame(settings.id_data))


def set_first(settings: bpy.types.PropertyGroup, reconstruction: Reconstruction) -> None:
    """Put the nearest large thing round the middle in focus, unless anything is, or keys are there."""
    if lens.is_in_focus(settings) or lens.has_keys(settings, "focus_distance") or settings.marks.items:
        return
    place = first_place(reconstruction, int(reconstruction.frames[0]))
    if place is None:
        return
    points = np.array(place.focus.points, np.int32)
    inverse = [point_inverse_depths(reconstruction, int(each), points) for each in reconstruction.frames]
    ahead, nearest = (~np.isnan(inverse)).any(axis=1), np.nanmax(inverse)
    if not ahead.all() or nearest * place.distance > NEARER:
        # The camera turns away from it, or passes it, and a lens of this aperture would blur all else away.
        place = replace(place, focus=Focus(distance=place.distance), source="a fixed distance")
    put_first(settings, place)


def put_first(settings: bpy.types.PropertyGroup, place: Place) -> None:
    """Put a place in focus that nobody has picked."""
    put(settings, place.frame, [replace(place, is_automatic=True)])


def _steady(settings: bpy.types.PropertyGroup, marks: Sequence[FocusMark]) -> float | None:
    """The distance of a single mark that needs no keys: held, by feature points, or bare."""
    if len(marks) > 1:
        return None
    (mark,) = marks
    if mark.holds:
        return float(1 / mark.inverse_depths(reconstruction_of(settings), [mark.frame])[0])
    if points := settings.marks.points:
        return lens.distance_at(settings, Focus(points), mark.frame)
    if len(mark.places) == 1 and mark.places[0].world is None and not mark.places[0].followed:
        return mark.places[0].distance
    return None


def _edit(mark: bpy.types.PropertyGroup, **changes: Any) -> None:
    """Change fields of a mark, and write the focus."""
    settings = mark.id_data.virtual_aperture
    marks = [replace(each.value, **changes) if each == mark else each.value for each in settings.marks.items]
    replace_all(settings, marks, changes.get("frame"))


def _free(mark: bpy.types.PropertyGroup, frame: int) -> int:
    """The first frame from one on that no other mark is at."""
    others = {other.frame for other in mark.id_data.virtual_aperture.marks.items if other != mark}
    return next(each for each in itertools.count(frame) if each not in others)


CLASSES = (VirtualApertureFocusMark, VirtualApertureFocusMarks)
