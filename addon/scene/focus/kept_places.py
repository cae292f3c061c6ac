"""Places and marks of the focus as they are kept in the .blend, and as the core has them."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ...core.focus.pull import FocusMark


def marks_of(settings: bpy.types.PropertyGroup) -> list[FocusMark]:
    """Return the marks as the core sees them."""
    return [
        FocusMark(each.frame, each.places, each.easing, each.pull, each.holds)
        for each in settings.marks.items
    ]


def fill(mark: bpy.types.PropertyGroup, places: Sequence[Place]) -> None:
    """Replace the places of a mark."""
    with np.errstate(divide="ignore"):
        mark.distance = 1 / np.mean(np.divide(1, [place.distance for place in places]))
    mark.name = _name_of(places)
    mark.kept = packed(places)


def at_distance(distance: float, frame: int) -> Place:
    """Return a bare distance as a place of a frame."""
    return Place(Focus(distance=distance), frame, distance, "a distance")


def packed(places: Sequence[Place]) -> str:
    """Return places as a mark keeps them, in JSON."""
    return json.dumps(list(map(_packed, places)), default=lambda value: value.tolist())


@lru_cache
def unpacked(kept: str) -> tuple[Place, ...]:
    """Return the places of `packed`."""
    return tuple(map(_place, json.loads(kept)))


def _packed(place: Place) -> dict[str, Any]:
    followed = {int(frame): away for frame, away in place.followed.items()}
    return asdict(replace(place, followed=followed, marks=None))


def _place(kept: dict[str, Any]) -> Place:
    points = {"points": tuple(kept["focus"]["points"])}
    followed = {int(frame): away for frame, away in kept["followed"].items()}
    world = None if kept["world"] is None else np.array(kept["world"])
    focus, xy = Focus(**kept["focus"] | points), kept["xy"] and tuple(kept["xy"])
    return Place(**kept | {"focus": focus, "followed": followed, "world": world, "xy": xy})


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
