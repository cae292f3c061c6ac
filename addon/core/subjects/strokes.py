"""Strokes by which the user marks a subject."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..base import numbers
from ..base.errors import UserError


@dataclass(frozen=True)
class Stroke:
    """A line over a subject in one frame, or over what does not belong to it."""

    frame: int
    """Number of the source frame."""
    places: tuple[tuple[float, float], ...]
    """Corners of the line, fractions of the picture, (0, 0) top left; a single one is a click."""
    adds: bool = True
    """Whether what is under it belongs to the subject."""


def places_of(words: Sequence[str]) -> tuple[tuple[float, float], ...]:
    """Corners of a stroke from words such as "0.44,0.26"; ValueError for anything else, UserError for a place
    that is outside of the picture."""
    return tuple(map(_place, words))


def _place(word: str) -> tuple[float, float]:
    if not re.fullmatch(r"[^,]+,[^,]+", word):
        raise ValueError(word)
    x, y = map(numbers.real, word.split(","))
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise UserError(f"the stroke's place {word} is outside the picture; both must be between 0 and 1")
    return x, y


def with_stroke(strokes: Sequence[Stroke], stroke: Stroke, extend: bool = False) -> tuple[Stroke, ...]:
    """Strokes with one more. One that adds takes the place of those in its frame, unless it is to `extend`
    them."""
    anew = stroke.adds and not extend
    return (*(each for each in strokes if not (anew and each.frame == stroke.frame)), stroke)


@dataclass(frozen=True)
class MarkedSubject:
    """A subject as the user marks it."""

    name: str
    strokes: tuple[Stroke, ...]

    @property
    def key(self) -> str:
        """16 hexadecimal digits that tell strokes from others, whatever the subject's name."""
        return hashlib.sha256(repr(self.strokes).encode()).hexdigest()[:16]
