"""Focus marks: the user's focus at frames.

One mark gives a constant focus. A distance that changes over the clip is written as one F-curve of the focus
distance (`focus_curve.py`); feature points alone are followed without keys.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.depth.sparse import point_inverse_depths
from ...core.focus.first_focus import first_place
from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ...core.focus.pull import FocusMark, unseen
from ..base.timeline import clip_frame
from ..lens import lens
from ..sources.shot import reconstruction_of
from . import focus_curve
from .kept_places import fill, marks_of

NEARER = 3.0
"""Times that the first focus may come nearer before it stays at its distance instead. In a clip of a
restaurant the camera passes its points: at their distance, discs of all else are as wide as a quarter of the
picture."""


def _rewrite(mark: VirtualApertureFocusMark, _context: bpy.types.Context) -> None:
    if not lens.is_writing():
        write(mark.id_data.virtual_aperture)


def _moved(mark: VirtualApertureFocusMark, _context: bpy.types.Context) -> None:
    if lens.is_writing():
        return
    settings = mark.id_data.virtual_aperture
    others = {other.frame for other in settings.marks.items if other != mark}
    frame = mark.frame
    with lens.writing():
        # There is one mark at a frame: past others it goes on.
        while frame in others:
            frame += 1
        mark.frame = frame
        _sort(settings, frame)
    write(settings)


class VirtualApertureFocusPoint(bpy.types.PropertyGroup):
    """One picked feature point."""

    point: IntProperty(name="Point", description="Vertex index of the point in the point cloud", min=0)


class VirtualApertureFocusPlace(bpy.types.PropertyGroup):
    """One place in focus of a mark: a `Place`."""

    frame: IntProperty(name="Frame", description="Frame it was picked in")
    xy: FloatVectorProperty(
        name="Place",
        description="Position as fractions of the image, from the top left",
        size=2,
        default=(-1, -1),
    )
    distance: FloatProperty(name="Distance", description="Distance in that frame, along the optical axis")
    source: StringProperty(name="Source", description="How its distance was found")
    points: CollectionProperty(type=VirtualApertureFocusPoint)
    through_points: BoolProperty(name="Plane Through Points")
    has_world: BoolProperty(name="Stands Still", description="Its position in 3D is known")
    world: FloatVectorProperty(name="3D Position", size=3)


class VirtualApertureFocusMark(bpy.types.PropertyGroup):
    """The focus at a frame; `name` is the source of its distance."""

    frame: IntProperty(name="Frame", description="Frame at which this is in focus", update=_moved)
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
        update=_rewrite,
    )
    pull: IntProperty(
        name="Pull Over",
        description="Frames before this mark in which focus moves to it; until then it stays on the previous"
        " one. 0 takes all frames between the two",
        min=0,
        update=_rewrite,
    )
    holds: BoolProperty(
        name="Hold Distance",
        description="Keep the distance at the mark's frame instead of following what was picked",
        update=_rewrite,
    )
    places: CollectionProperty(type=VirtualApertureFocusPlace)
    distance: FloatProperty(
        name="Distance",
        description="Distance from the camera at its frame, in scene units",
        subtype="DISTANCE",
    )


class VirtualApertureFocusMarks(bpy.types.PropertyGroup):
    """The list of focus marks, in the order of their frames."""

    items: CollectionProperty(type=VirtualApertureFocusMark)
    active: IntProperty(name="Active Focus Mark", options={"HIDDEN"})
    written: StringProperty(
        name="Written",
        description="Digest of the keyframes written by the marks; empty if there are none",
        options={"HIDDEN"},
    )
    unseen: StringProperty(
        name="Not Seen", description="Frames in which the thing in focus cannot be seen", options={"HIDDEN"}
    )
    is_first: BoolProperty(
        name="First Focus", description="Set automatically, not picked yet", options={"HIDDEN"}
    )


def put(
    settings: bpy.types.PropertyGroup, frame: int, places: Sequence[Place], add: bool = False
) -> bpy.types.PropertyGroup:
    """Put places in focus at a frame, and write the focus; the mark.

    The one mark that there is gives way, unless one is to be added; of several the one at this frame does.
    """
    group = settings.marks
    with lens.writing():
        # Keys that the user deleted do not come back.
        gone = focus_curve.is_users(settings) and not lens.has_keys(settings, "focus_distance")
        if gone or (not add and len(group.items) < 2):
            group.items.clear()
        elif not len(group.items):
            _add_present(settings)
        mark = at_frame(settings, frame)
        if mark is None:
            mark = group.items.add()
        mark.frame = frame
        fill(mark, places)
        group.is_first = False
        _sort(settings, frame)
    write(settings)
    found = at_frame(settings, frame)
    assert found is not None
    return found


def _add_present(settings: bpy.types.PropertyGroup) -> None:
    """Add a mark for a focus without one: points set by a script, or a distance."""
    focus, distance, frame = lens.focus_of_settings(settings), settings.focus_distance, settings.focus_frame
    if focus.points or distance > 0:
        mark = settings.marks.items.add()
        mark.frame = frame
        fill(mark, [Place(replace(focus, tilt=0.0, swing=0.0), frame, distance or 1.0, "picked before")])


def replace_all(settings: bpy.types.PropertyGroup, marks: Iterable[FocusMark]) -> None:
    """Have these marks and no others, and write the focus."""
    with lens.writing():
        settings.marks.items.clear()
        for each in marks:
            mark = settings.marks.items.add()
            mark.frame, mark.easing, mark.pull, mark.holds = each.frame, each.easing, each.pull, each.holds
            fill(mark, each.places)
        settings.marks.is_first = False
        _sort(settings)
    write(settings)


def at_frame(settings: bpy.types.PropertyGroup, frame: int) -> bpy.types.PropertyGroup | None:
    """Return the mark at a frame."""
    return next((mark for mark in settings.marks.items if mark.frame == frame), None)


def on_distance(settings: bpy.types.PropertyGroup) -> None:
    """Replace the only mark by a distance that was set by hand."""
    group, distance = settings.marks, settings.focus_distance
    if len(group.items) != 1 or not distance > 0 or lens.has_keys(settings, "focus_distance"):
        return
    (mark,) = group.items
    fill(mark, [Place(Focus(distance=distance), mark.frame, distance, "a distance")])
    group.is_first = False


def move(settings: bpy.types.PropertyGroup, index: int, frame: int) -> None:
    """Move a mark to a frame; UserError where another one is."""
    mark, other = settings.marks.items[index], at_frame(settings, frame)
    if other is not None and other != mark:
        raise UserError(f"frame {frame} already has a focus mark; remove that one first")
    with lens.writing():
        mark.frame = frame
        _sort(settings, frame)
    write(settings)


def remove(settings: bpy.types.PropertyGroup, index: int) -> None:
    """Take a mark away; without any the focus stays at its distance, without keys."""
    group = settings.marks
    with lens.writing():
        group.items.remove(index)
        group.active = max(min(group.active, len(group.items) - 1), 0)
        group.is_first = False
    write(settings)


def clear(settings: bpy.types.PropertyGroup) -> None:
    """Remove the marks and their keys; the caller sets the focus."""
    with lens.writing():
        if not are_keys_users(settings):
            focus_curve.remove(settings)
        settings.marks.items.clear()
        settings.marks.is_first = False


def are_keys_users(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the focus distance has keys that no marks wrote, or that the user has edited since."""
    return lens.has_keys(settings, "focus_distance") and focus_curve.is_users(settings)


def say_the_focus(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the focus is that of the marks, and no script has changed it since."""
    group = settings.marks
    if not len(group.items) or lens.has_keys(settings, "focus_distance"):
        return bool(len(group.items))
    steady, own = _steady(settings, marks_of(settings)), lens.focus_of_settings(settings)
    if steady is None or steady.points != own.points:
        return False
    return bool(own.points) or settings.focus_distance == group.items[0].distance


def take_keys_over(settings: bpy.types.PropertyGroup) -> None:
    """Write the focus in place of keys of the user's."""
    focus_curve.remove(settings)
    write(settings)


def write(settings: bpy.types.PropertyGroup) -> None:
    """Set the focus of the marks, by keys where its distance changes; the user's keys stay."""
    if are_keys_users(settings):
        return
    marks, at = sorted(marks_of(settings), key=lambda mark: mark.frame), lens.focus_of_settings(settings)
    with lens.writing():
        _sort(settings)
        hidden = unseen_of(settings, marks)
        settings.marks.unseen = " ".join(map(str, hidden))
        if not marks:
            focus_curve.remove(settings)
            lens.clear_points(settings)
            return
        first, steady = marks[0], _steady(settings, marks)
        focus = steady or Focus(distance=float(np.mean([place.distance for place in first.places])))
        focus = replace(focus, tilt=at.tilt, swing=at.swing)
        if steady is not None:
            focus_curve.remove(settings)
            lens.set_focus(settings, focus, first.frame)
            settings.marks.items[0].distance = settings.focus_distance
            return
        distances = focus_curve.write(settings, marks, hidden)
        lens.set_focus(settings, replace(focus, distance=distances[first.frame]), first.frame)
        settings.focus_distance = focus_curve.value(settings, clip_frame(settings.id_data))
        for mark in settings.marks.items:
            mark.distance = focus_curve.value(settings, mark.frame)


def unseen_of(settings: bpy.types.PropertyGroup, marks: Sequence[FocusMark]) -> list[int]:
    """Return the frames of the clip that do not show a followed mark."""
    frames = range(settings.clip_first, settings.clip_last + 1)
    return unseen(marks, reconstruction_of(settings), frames) if marks else []


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
        place = replace(place, focus=Focus(distance=place.distance))
    put_first(settings, place)


def put_first(settings: bpy.types.PropertyGroup, place: Place) -> None:
    """Put a place in focus that nobody has picked. With an assumed scale, the aperture follows the blur."""
    if not settings.metres_per_unit > 0:
        with lens.writing():
            settings.aperture_radius = 0.0
    put(settings, place.frame, [place])
    settings.marks.is_first = True


def _steady(settings: bpy.types.PropertyGroup, marks: Sequence[FocusMark]) -> Focus | None:
    """The focus of a single mark that needs no keys: feature points, or a bare distance."""
    if len(marks) > 1:
        return None
    places = marks[0].places
    if marks[0].holds:
        inverse = marks[0].inverse_depths(reconstruction_of(settings), [marks[0].frame])
        return Focus(distance=float(1 / inverse[0]))
    if all(place.focus.points for place in places):
        points = dict.fromkeys(point for place in places for point in place.focus.points)
        through = any(place.focus.through_points for place in places)
        return Focus(points=tuple(points), through_points=through)
    if len(places) == 1 and places[0].world is None and not places[0].followed:
        return Focus(distance=places[0].distance)
    return None


def _sort(settings: bpy.types.PropertyGroup, active: int | None = None) -> None:
    """The marks by frame; the one at frame `active` becomes the active one."""
    group = settings.marks
    chosen = group.items[group.active].frame if group.active < len(group.items) else 0
    chosen = chosen if active is None else active
    for goal, frame in enumerate(sorted(mark.frame for mark in group.items)):
        group.items.move(
            next(n for n, mark in enumerate(group.items) if n >= goal and mark.frame == frame), goal
        )
    group.active = next((n for n, mark in enumerate(group.items) if mark.frame == chosen), 0)


CLASSES = (
    VirtualApertureFocusPoint,
    VirtualApertureFocusPlace,
    VirtualApertureFocusMark,
    VirtualApertureFocusMarks,
)
