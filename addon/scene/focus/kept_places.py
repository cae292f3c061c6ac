"""Places and marks of the focus as they are kept in the .blend, and as the core has them."""

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ...core.focus.pull import FocusMark

FOLLOWED, FOLLOWED_FRAMES = "followed", "followed_frames"
"""Custom properties of a place on a moving object: its distances, and the frames of those."""


def places_of(mark: bpy.types.PropertyGroup) -> tuple[Place, ...]:
    """Return the places of a mark; of one without any, its bare distance."""
    if not len(mark.places):
        return (Place(Focus(distance=mark.distance), mark.frame, mark.distance, "a distance"),)
    return tuple(map(_place, mark.places))


def marks_of(settings: bpy.types.PropertyGroup) -> list[FocusMark]:
    """Return the marks as the core sees them."""
    return [
        FocusMark(mark.frame, places_of(mark), mark.easing, mark.pull, mark.holds)
        for mark in settings.marks.items
    ]


def fill(mark: bpy.types.PropertyGroup, places: Sequence[Place]) -> None:
    """Replace the places of a mark."""
    mark.places.clear()
    mark.distance = float(1 / np.mean([1 / place.distance for place in places]))
    mark.name = _name_of(places)
    if len(places) == 1 and _is_bare(places[0]):
        return
    for place in places:
        kept = mark.places.add()
        kept.frame, kept.distance, kept.source = place.frame, place.distance, place.source
        kept.through_points = place.focus.through_points
        if place.xy is not None:
            kept.xy = place.xy
        for point in place.focus.points:
            kept.points.add().point = point
        if place.world is not None:
            kept.has_world, kept.world = True, place.world
        if place.followed:
            frames = sorted(place.followed)
            kept[FOLLOWED_FRAMES] = np.array(frames, np.int32)
            kept[FOLLOWED] = np.array([place.followed[frame] for frame in frames])


def _is_bare(place: Place) -> bool:
    return not (place.focus.points or place.followed) and place.world is None


def _place(kept: bpy.types.PropertyGroup) -> Place:
    points = tuple(entry.point for entry in kept.points)
    focus = Focus(points, through_points=kept.through_points) if points else Focus(distance=kept.distance)
    followed: dict[int, float] = {}
    if FOLLOWED in kept:
        followed = dict(zip(map(int, kept[FOLLOWED_FRAMES]), map(float, kept[FOLLOWED]), strict=True))
    world = np.array(kept.world, np.float64) if kept.has_world else None
    xy = (float(kept.xy[0]), float(kept.xy[1])) if kept.xy[0] >= 0 else None
    return Place(focus, kept.frame, kept.distance, kept.source, world, followed, xy)


def _name_of(places: Sequence[Place]) -> str:
    """A short name of the picked thing for a list; the thumbnail shows the rest."""
    if len(places) > 1:
        return "Places"
    (place,) = places
    if place.subject:
        return f"{place.subject[0].upper()}{place.subject[1:]}"
    if place.xy is not None or place.world is not None or place.followed:
        return "Place"
    return "Point cloud" if place.focus.points else "Distance"
