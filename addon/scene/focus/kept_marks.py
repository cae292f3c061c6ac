"""Marks of the focus as they are kept in the .blend."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ...core.focus.pull import FocusMark


def at_distance(distance: float, frame: int) -> Place:
    """Return a bare distance as a place of a frame."""
    return Place(Focus(distance=distance), frame, distance, "a distance")


def packed(mark: FocusMark) -> str:
    """Return a mark as it is kept, in JSON; its name is kept beside it."""
    places = tuple(replace(place, marks=None) for place in mark.places)
    return json.dumps(asdict(replace(mark, places=places, name="")), default=lambda value: value.tolist())


@lru_cache
def unpacked(kept: str) -> FocusMark:
    """Return the mark of `packed`, without a name."""
    fields = json.loads(kept)
    return FocusMark(**fields | {"places": tuple(map(place_of, fields["places"]))})


def place_of(kept: dict[str, Any]) -> Place:
    """Return a place of a mark that was kept."""
    points = {"points": tuple(kept["focus"]["points"])}
    followed = {int(frame): away for frame, away in kept["followed"].items()}
    world = None if kept["world"] is None else np.array(kept["world"])
    focus, xy = Focus(**kept["focus"] | points), kept["xy"] and tuple(kept["xy"])
    return Place(**kept | {"focus": focus, "followed": followed, "world": world, "xy": xy})


def name_of(places: Sequence[Place]) -> str:
    """Return a short name of the picked thing for a list; the thumbnail shows the rest."""
    if len(places) > 1:
        return "Places"
    (place,) = places
    # Animals are found as people, too.
    if name := {"person": "subject"}.get(place.subject, place.subject):
        return f"{name[0].upper()}{name[1:]}"
    if place.xy is not None or place.world is not None or place.followed:
        return "Place"
    return "Point cloud" if place.focus.points else "Distance"
