"""What the sweep cannot say: depth where there are only sparse points, and of what moves by itself."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .dense_sweep import Map
from .reconstruction import Floats

Mask = NDArray[np.bool_]

REACH, EDGE = 400.0, 6.0
"""Of the smoother that spreads known depth: its lambda, and the grey levels that stop it."""
FAINT = 1e-6
"""Weight of a frame's usual depth where nothing known reaches."""
PIN, PIN_REACH = 3.0, 4.0
"""Grey levels by which a feature's own depth is preferred, and levels from which on all others are alike."""
WINDOW, ALIKE, NEAR = 9, 1.5, 3.0
"""Of the filter that smooths surfaces: pixels, and the standard deviations in levels and in pixels."""
FOOT = 4
"""Pixels below a moving thing, where what it stands on is seen."""
STANDS = 0.25
"""Confidence in a depth that is only that of where a thing stands."""


def spread(guide: Map, value: Map, weight: Map, usual: float) -> Map:
    """(h, w) values carried from where their weight is high, along the surfaces of a grey picture.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014, of weight * value over
    that of weight; `usual` where no weight reaches.
    """
    picture = np.clip(guide, 0, 255).astype(np.uint8)
    scale = abs(usual) or 1.0
    above, below = (
        cv2.ximgproc.fastGlobalSmootherFilter(picture, np.ascontiguousarray(part, np.float32), REACH, EDGE)
        for part in (weight * (value / scale - usual / scale), weight)
    )
    return np.asarray(usual + scale * above / (np.maximum(below, 0) + FAINT), np.float32)


def splat(xy: Floats, value: Floats, shape: tuple[int, int]) -> tuple[Map, Map]:
    """Mean of the values (n,) at places (n, 2) in each pixel (h, w), and how many there are."""
    height, width = shape
    column, row = np.floor(xy).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    flat = row[inside] * width + column[inside]
    count = np.bincount(flat, minlength=height * width)
    total = np.bincount(flat, weights=value[inside], minlength=height * width)
    mean = total / np.maximum(count, 1)
    return mean.reshape(shape).astype(np.float32), count.reshape(shape).astype(np.float32)


def pin(costs: Map, known: Map, count: Map, levels: Floats) -> None:
    """Prefer in costs (k, h, w) the inverse depths known (h, w) where their count is not zero, and around."""
    row, column = np.nonzero(cv2.dilate(count, np.ones((3, 3))))
    total, number = (cv2.boxFilter(part, -1, (3, 3), normalize=False) for part in (known * count, count))
    off = np.abs(levels[:, None] - (total / np.maximum(number, 1))[row, column]) / (levels[1] - levels[0])
    costs[:, row, column] += (PIN * np.minimum(off / PIN_REACH, 1)).astype(np.float32)


def smooth(level: Map) -> Map:
    """(h, w) levels without the unevenness of surfaces; jumps stay."""
    return np.asarray(cv2.medianBlur(cv2.bilateralFilter(level, WINDOW, ALIKE, NEAR), 3), np.float32)


def settle(guide: Map, inverse: Map, confidence: Map, moving: Mask) -> tuple[Map, Map]:
    """Inverse depth and confidence (h, w), with what moves set upright on what is seen at its foot.

    Where nothing is seen there it has the depth of what is around it.
    """
    inverse, confidence = inverse.copy(), confidence.copy()
    weight = np.where(moving, 0, confidence + np.float32(FAINT)).astype(np.float32)
    around = spread(guide, inverse, weight, float(np.median(inverse)))
    number, labels = cv2.connectedComponents(moving.astype(np.uint8))
    for label in range(1, number):
        thing = labels == label
        foot = np.zeros_like(thing)
        foot[FOOT:] = thing[:-FOOT]
        foot &= ~moving & (confidence > STANDS)
        inverse[thing] = np.median(inverse[foot]) if foot.sum() >= FOOT else around[thing]
    confidence[moving] = np.minimum(confidence[moving], STANDS)
    return inverse, confidence
