"""The focus as version 1.0 stored it, taken over into the marks."""

from typing import Any

import bpy
import numpy as np

from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ..lens import lens
from .kept_places import at_distance, fill, packed

POINTS = 0
"""Number of the item of `focus_by` with which points counted before the distance."""


def take_over(settings: bpy.types.PropertyGroup) -> None:
    """Replace what version 1.0 stored of the focus by marks; settings of later versions stay as they are."""
    stored: Any = settings.bl_system_properties_get()
    if stored is None:
        return
    group: Any = stored.get("marks") or {}
    is_first = bool(group.pop("is_first", False)) if group else False
    for mark, old in zip(settings.marks.items, group.get("items", ()), strict=True):
        if places := old.pop("places", None):
            mark.kept = packed([_place(each, is_first) for each in places])
    if not {"focus_by", "focus_points"} & set(stored.keys()):
        return
    points = tuple(each.get("point", 0) for each in stored.pop("focus_points", ()))
    points = points if stored.pop("focus_by", POINTS) == POINTS else ()
    frame, distance = stored.pop("focus_frame", 0), settings.focus_distance
    marks = settings.marks.items
    has_place = len(marks) or lens.is_keyed(settings, "focus_distance") or not distance > 0
    if points == settings.marks.points and has_place:
        return
    # Points or a distance that a command or a script had set.
    with lens.writing():
        marks.clear()
        mark = marks.add()
        mark.frame = frame
        focus = Focus(points, through_points=settings.focus_through_points)
        fill(mark, [Place(focus, frame, distance, "points") if points else at_distance(distance, frame)])


def _place(old: Any, is_first: bool) -> Place:
    points, distance = tuple(each.get("point", 0) for each in old.get("points", ())), old.get("distance", 0.0)
    through = bool(old.get("through_points", False))
    x, y = old.get("xy", (-1, -1))
    return Place(
        Focus(points, through_points=through) if points else Focus(distance=distance),
        old.get("frame", 0), distance, old.get("source", ""),
        np.array(old["world"]) if old.get("has_world", False) else None,
        dict(zip(old.get("followed_frames", ()), old.get("followed", ()), strict=True)),
        (x, y) if x >= 0 else None, is_automatic=is_first,
    )  # fmt: skip
