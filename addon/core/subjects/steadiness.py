"""In which frames what moves is found otherwise than in those before, more than a subject can change."""

import itertools
from collections.abc import Iterable

import cv2
import numpy as np

from ..base.arrays import Mask
from .people import SMALLEST

SIDE = 160
"""Pixels of the longer side that masks are compared at: an outline that is a pixel off counts little."""
LIKENESS, GROWTH = 0.35, 0.7
"""Intersection over union, and ratio of areas, below which two frames do not show one subject. In the
benchmark's scenes a subject found in all frames has an IoU of at least 0.89, and two that cross have 0.37 and
0.82 in their worst frames. A subject that is lost in most frames is below in 17 of 59."""


def jumps(masks: Iterable[Mask]) -> list[int]:
    """Return the numbers, from 1 on, of masks (h, w) that differ too much from the one before them."""
    return [number for number, pair in enumerate(itertools.pairwise(masks), 1) if _is_jump(*pair)]


def _is_jump(before: Mask, after: Mask) -> bool:
    small, large = sorted(float(mask.mean()) for mask in (before, after))
    return large > SMALLEST and (small < GROWTH * large or likeness(before, after) < LIKENESS)


def likeness(before: Mask, after: Mask) -> float:
    """Return the intersection over union of moving pixels in two neighbouring frames, in [0, 1].

    The first mask (h, w) is moved onto the second one (h, w). Two empty masks have 1.
    """
    one, other = (_small(mask) for mask in (before, after))
    if not one.any() or not other.any():
        return float(one.any() == other.any())
    (from_row, from_column), (row, column) = (np.argwhere(mask).mean(axis=0) for mask in (one, other))
    move = np.array([[1, 0, column - from_column], [0, 1, row - from_row]], np.float32)
    moved = cv2.warpAffine(one.astype(np.uint8), move, one.shape[::-1], flags=cv2.INTER_NEAREST) > 0
    union = np.count_nonzero(moved | other)
    return float(np.count_nonzero(moved & other) / union) if union else 1.0


def _small(mask: Mask) -> Mask:
    times = min(1.0, SIDE / max(mask.shape))
    size = tuple(max(round(side * times), 1) for side in mask.shape[::-1])
    return np.asarray(cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5)
