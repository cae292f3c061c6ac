"""Scale of a clip by the height of the people in it."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Mask
from ..depth.flat_scene import ADULT
from ..subjects.people import sampled
from .clip_context import ClipContext

LEAST_HEIGHT = 0.15
"""Share of the picture's height of a person whose height is measured: outlines are off by two pixels."""
UPRIGHT = 2.0
"""Height over width from which on a person stands or walks."""
LEAST_FRAMES = 2
"""Frames that must agree."""
LARGEST_SPREAD = 0.25
"""Relative standard deviation of the scales by frames and people with which the guess means nothing."""


def scale_by_people(clip: ClipContext) -> float | None:
    """Guess the metres of a scene unit by the whole figures of people that stand or walk; passes checkpoints.

    None without such people, or where they disagree. Raises UserError if a frame cannot be read.
    """
    found = []
    frames = sampled([int(frame) for frame in clip.reconstruction.frames])
    for person in clip.people if clip.may_focus_on_subjects else ():
        followed = clip.subject_place(person.name, frames[0]).followed
        for frame in frames:
            if (share := height_of(person.mask(frame))) is not None:
                camera = clip.canvas(frame).camera
                # Children are taken to be farther away than they are.
                found.append(ADULT / (share * camera.height / camera.fy * followed[frame]))
    if len(found) < LEAST_FRAMES or np.std(found) > LARGEST_SPREAD * np.mean(found):
        return None
    return float(np.median(found))


def height_of(mask: Mask) -> float | None:
    """Return the height of an upright person (h, w), a share of the picture's; None if it is cut or bends."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows) or rows[0] <= 1 or rows[-1] >= len(mask) - 2:
        return None
    height, width = len(range(rows[0], rows[-1] + 1)), len(range(columns[0], columns[-1] + 1))
    is_measured = height >= max(UPRIGHT * width, LEAST_HEIGHT * len(mask))
    return height / len(mask) if is_measured else None
