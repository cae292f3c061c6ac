"""What the sweep cannot say: depth where there are only sparse points, and of what moves by itself."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera.reconstruction import Floats
from .plane_sweep import Map

Mask = NDArray[np.bool_]

REACH, EDGE = 400.0, 6.0
"""Of the smoother that spreads known depth: its lambda, and the grey levels that stop it."""
FAINT = 1e-6
"""Weight of a frame's usual depth where nothing known reaches."""
PIN, PIN_REACH = 3.0, 4.0
"""Grey levels by which a feature's own depth is preferred, and levels from which on all others are alike."""
WINDOW, ALIKE, NEAR = 9, 1.5, 3.0
"""Of the filter that smooths surfaces: pixels, and the standard deviations in levels and in pixels."""
FOOT, LOWEST = 4, 0.1
"""Pixels below a moving thing, where what it stands on is seen, and the share of its height that is its
foot."""
FARTHEST = 10
"""Percentile of what is seen there that counts as the farthest."""
CLOSE, FAR = 5, 12
"""Pixels between which things are beside it; what is closer may be the thing itself."""
BINS, FEW, LEAST, HIDES = 24, 20, 0.05, 0.3
"""Classes of depth beside it, pixels and the share of all that one must have, and of those the share that is
hidden by it elsewhere: of what stands before it, less is, by mistakes of its depth."""
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


def settle(guide: Map, inverse: Map, confidence: Map, moving: Mask, covered: Mask) -> tuple[Map, Map, Mask]:
    """Inverse depth and confidence (h, w) with what moves set upright where it stands; and what moves.

    Each connected thing gets one depth, so that it is not torn: that of what is seen at its lowest pixels, or
    nearer, before everything beside it that it hides from a neighbour, which `covered` (h, w) tells. A thing
    that neither touches nor hides anything has the depth of what is around it. Holes in it that seem nearer
    than the thing itself are parts of it.
    """
    inverse, confidence, moving = inverse.copy(), confidence.copy(), moving.copy()
    weight = np.where(moving, 0, confidence + np.float32(FAINT)).astype(np.float32)
    around = spread(guide, inverse, weight, float(np.median(inverse)))
    sure = ~moving & (confidence > STANDS)
    number, labels, stats, _ = cv2.connectedComponentsWithStats(moving.astype(np.uint8), connectivity=8)
    for label in range(1, number):
        # Nothing farther than the ring beside a thing plays a part.
        left, top, width, height, _ = stats[label]
        part = np.s_[max(top - FAR, 0) : top + height + FAR, max(left - FAR, 0) : left + width + FAR]
        thing = labels[part] == label
        bounds = (
            _contact(thing, sure[part], inverse[part]),
            _hides(thing, sure[part], covered[part], inverse[part]),
        )
        told = [one for one in bounds if one is not None]
        depth = max(told) if told else float(np.median(around[part][thing]))
        thing |= _filled(thing) & ((inverse[part] >= depth) | ~sure[part])
        inverse[part][thing], moving[part][thing] = depth, True
    confidence[moving] = np.minimum(confidence[moving], STANDS)
    return inverse, confidence, moving


def _contact(thing: Mask, sure: Mask, inverse: Map) -> float | None:
    """The inverse depth that is seen at the lowest pixels of a thing (h, w), None if nothing is.

    Of several the farthest: what is nearer stands before it.
    """
    rows = np.nonzero(thing.any(axis=1))[0]
    lowest = rows[-1] - round(LOWEST * len(rows))
    below = np.zeros_like(thing)
    below[FOOT:] = thing[:-FOOT]
    below[:lowest] = False
    found = inverse[below & ~thing & sure]
    return float(np.percentile(found, FARTHEST)) if len(found) >= FOOT else None


def _hides(thing: Mask, sure: Mask, covered: Mask, inverse: Map) -> float | None:
    """The inverse depth of the nearest of what is beside a thing (h, w) and hidden by it elsewhere."""
    away = cv2.distanceTransform((~_filled(thing)).astype(np.uint8), cv2.DIST_L2, 5)
    beside = (away > CLOSE) & (away <= FAR) & sure
    if np.count_nonzero(beside) < FEW:
        return None
    values, is_hidden = inverse[beside], covered[beside]
    least, most = np.percentile(values, [1, 99])
    edges = np.linspace(least, most, BINS + 1)
    binned = (np.histogram(some, edges)[0] for some in (values, values[is_hidden]))
    count, hidden = (np.convolve(some, [1, 1, 1], "same") for some in binned)
    classes = np.nonzero((count >= max(FEW, LEAST * len(values))) & (hidden > HIDES * count))[0]
    if not len(classes):
        return None
    nearest = int(classes[-1])
    low, high = edges[max(nearest - 1, 0)], edges[min(nearest + 2, BINS)]
    return float(np.median(values[(values >= low) & (values <= high)]))


def _filled(thing: Mask) -> Mask:
    """A thing (h, w) with its holes."""
    outside = np.pad((~thing).astype(np.uint8), 1, constant_values=1)
    cv2.floodFill(outside, None, (0, 0), 2)  # type: ignore[call-overload]
    return np.asarray(outside[1:-1, 1:-1] != 2)
