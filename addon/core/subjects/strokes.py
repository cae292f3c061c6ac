"""Strokes by which the user marks a subject."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base import numbers
from ..base.arrays import Mask
from ..base.errors import UserError

BESIDE = 0.1
"""Distance of a stroke from the subject it corrects, over the long side: a missing arm. Not measured."""


@dataclass(frozen=True)
class Stroke:
    """A line over a subject in one frame, or over what does not belong to it."""

    frame: int
    """Number of the source frame."""
    places: tuple[tuple[float, float], ...]
    """Corners of the line, fractions of the picture, (0, 0) top left; a single one is a click."""
    adds: bool = True
    """True if the pixels under the stroke belong to the subject."""


def places_of(words: Sequence[str]) -> tuple[tuple[float, float], ...]:
    """Return the corners of a stroke from words such as "0.44,0.26".

    Raises:
        ValueError: A word is not a pair of numbers.
        UserError: A place is outside of the picture.
    """
    return tuple(map(_place, words))


def _place(word: str) -> tuple[float, float]:
    if not re.fullmatch(r"[^,]+,[^,]+", word):
        raise ValueError(word)
    x, y = map(numbers.real, word.split(","))
    if not (0 <= x <= 1 and 0 <= y <= 1):
        raise UserError(f"the stroke's place {word} is outside the picture; both must be between 0 and 1")
    return x, y


def down(mask: Mask, corners: int) -> tuple[tuple[float, float], ...]:
    """Return the corners of a stroke down the middle of a subject.

    Args:
        mask: (h, w) the subject.
        corners: Bands of even height, of each of which the innermost pixel is one; fewer where a band has
            none.

    Returns:
        Shares of the picture, (0, 0) top left, from top to bottom.
    """
    height, width = mask.shape
    deep = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_L2, 5)[1:-1, 1:-1]
    rows = np.flatnonzero(mask.any(axis=1))
    bands = np.array_split(np.arange(rows[0], rows[-1] + 1), corners) if len(rows) else []
    found = []
    for band in bands:
        own = deep[band[0] : band[-1] + 1] if len(band) else np.zeros((1, 1))
        if own.any():
            row, column = np.unravel_index(int(own.argmax()), own.shape)
            found.append(((column + 0.5) / width, (band[0] + row + 0.5) / height))
    return tuple((float(x), float(y)) for x, y in found)


def nearest_to(stroke: Stroke, masks: Mapping[str, Mask]) -> str | None:
    """Return the name of the subject that a stroke is over or beside.

    Args:
        stroke: The stroke.
        masks: (h, w) each subject in the stroke's frame, by name.

    Returns:
        The subject nearest to a corner of the stroke; None where all are farther away than `BESIDE`.
    """
    away = dict[str, float]()
    for name, mask in masks.items():
        height, width = mask.shape
        at = (np.array(stroke.places) * (width, height)).astype(int).clip(0, (width - 1, height - 1))
        if mask.any():
            far = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
            away[name] = float(far[at[:, 1], at[:, 0]].min()) / max(height, width)
    nearest = min(away, key=lambda name: away[name], default=None)
    return nearest if nearest is not None and away[nearest] <= BESIDE else None


def with_stroke(strokes: Sequence[Stroke], stroke: Stroke, extend: bool = False) -> tuple[Stroke, ...]:
    """Strokes with one more.

    One that adds takes the place of those in its frame, unless it is to `extend` them.
    """
    anew = stroke.adds and not extend
    return (*(each for each in strokes if not (anew and each.frame == stroke.frame)), stroke)


@dataclass(frozen=True)
class MarkedSubject:
    """A subject as the user marks it."""

    name: str
    strokes: tuple[Stroke, ...]

    @property
    def key(self) -> str:
        """16 hexadecimal digits that identify the strokes, whatever the subject's name."""
        return hashlib.sha256(repr(self.strokes).encode()).hexdigest()[:16]
