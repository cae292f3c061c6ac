"""What the sweep cannot say: depth where there are only sparse points, and of what moves by itself."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask


@dataclass(frozen=True)
class CompletionOptions:
    """Edge-aware interpolation, the sparse prior, and the placing of moving objects. Set by eye, then judged
    together on the scenes with true depth by `python -m benchmarks.accuracy.dense_depth`."""

    smoother_lambda: float = 400.0
    """Lambda of the fast global smoother that interpolates known depth. By eye."""
    smoother_sigma: float = 6.0
    """Grey levels at which that smoother stops. By eye."""
    least_weight: float = 1e-6
    """Weight, against 1 for a known pixel, of the default depth where nothing known reaches. By eye."""
    prior_cost: float = 3.0
    """Grey levels by which levels far from a feature's own depth cost more. By eye."""
    prior_reach: float = 4.0
    """Levels from a feature's own from which on all others cost the same. By eye."""
    filter_window: int = 9
    """Pixels across the bilateral filter that smooths surfaces. By eye."""
    filter_sigma_level: float = 1.5
    """Levels: standard deviation of that bilateral filter in depth. By eye."""
    filter_sigma_space: float = 3.0
    """Pixels: standard deviation of that bilateral filter in the picture. By eye."""
    foot_offset: int = 4
    """Pixels below a moving object at which what it stands on is seen. By eye."""
    foot_share: float = 0.1
    """Share of a moving object's height, from its lowest pixel, that is its foot. By eye."""
    ground_percentile: float = 10.0
    """Percentile of the inverse depths seen below a moving object's foot that it stands on: what is nearer
    stands before it. With 50 the bench's fence has 30.9 instead of 33.6 dB at 32 px, from the video alone."""
    ring_inner: int = 5
    """Pixels around a moving object that may be the object itself. By eye."""
    ring_outer: int = 12
    """Pixels around a moving object within which things are beside it. By eye."""
    ring_bins: int = 24
    """Classes of inverse depth in the ring around a moving object. By eye."""
    class_pixels: int = 20
    """Pixels that a class in the ring must have to count. By eye."""
    class_share: float = 0.05
    """Share of the ring that a class must have to count. By eye."""
    occluded_share: float = 0.3
    """Share of a class's pixels that the object hides in some neighbour, if it stands before them; of what
    stands before the object it is less, by errors of its depth. By eye."""
    moving_confidence: float = 0.25
    """Confidence, 0 to 1, in the depth of a moving object, which is only that of where it stands. By eye."""
    hovering_confidence: float = 0.15
    """Confidence in that of one which neither touches nor hides anything, whatever is around. By eye."""


def interpolate(guide: Map, value: Map, weight: Map, default: float, options: CompletionOptions) -> Map:
    """(h, w) values interpolated from where their weight (h, w) is high, along the surfaces of a picture (h,
    w) in grey levels; `default` where no weight reaches.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014, of weight * value over
    that of weight.
    """
    picture = np.clip(guide, 0, 255).astype(np.uint8)
    scale = abs(default) or 1.0
    above, below = (
        cv2.ximgproc.fastGlobalSmootherFilter(
            picture, np.ascontiguousarray(part, np.float32), options.smoother_lambda, options.smoother_sigma
        )
        for part in (weight * (value / scale - default / scale), weight)
    )
    return np.asarray(default + scale * above / (np.maximum(below, 0) + options.least_weight), np.float32)


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


def add_sparse_prior(costs: Map, known: Map, count: Map, levels: Floats, options: CompletionOptions) -> None:
    """Prefer in costs (k, h, w), at inverse depths `levels` (k,), those known (h, w) from features where
    their count (h, w) is not zero, and in the pixels beside."""
    row, column = np.nonzero(cv2.dilate(count, np.ones((3, 3))))
    total, number = (cv2.boxFilter(part, -1, (3, 3), normalize=False) for part in (known * count, count))
    off = np.abs(levels[:, None] - (total / np.maximum(number, 1))[row, column]) / (levels[1] - levels[0])
    costs[:, row, column] += (options.prior_cost * np.minimum(off / options.prior_reach, 1)).astype(
        np.float32
    )


def smooth(level: Map, options: CompletionOptions) -> Map:
    """(h, w) levels without the unevenness of surfaces; jumps stay.

    Tomasi and Manduchi, "Bilateral filtering for gray and color images", 1998, then a median of 3x3.
    """
    filtered = cv2.bilateralFilter(
        level, options.filter_window, options.filter_sigma_level, options.filter_sigma_space
    )
    return np.asarray(cv2.medianBlur(filtered, 3), np.float32)


def place_moving_objects(
    guide: Map, inverse: Map, confidence: Map, moving: Mask, occluding: Mask, options: CompletionOptions
) -> tuple[Map, Map, Mask]:
    """Inverse depth and confidence (h, w) with each moving object upright where it stands; and what moves (h,
    w).

    Each connected moving object gets one depth, so that it is not torn: that of what is seen at its lowest
    pixels, or nearer, before everything beside it that it hides from a neighbour, which `occluding` (h, w)
    tells. One that neither touches nor hides anything has the depth of what is around it, interpolated along
    `guide` (h, w), the picture in grey levels. Holes in a moving object that seem nearer than itself are
    parts of it. All of it is as sure as where it stands, whatever was matched within; where nothing around
    is sure, not at all.
    """
    inverse, confidence, moving = inverse.copy(), confidence.copy(), moving.copy()
    weight = np.where(moving, 0, confidence + np.float32(options.least_weight)).astype(np.float32)
    around = interpolate(guide, inverse, weight, float(np.median(inverse)), options)
    sure = ~moving & (confidence > options.moving_confidence)
    number, labels, stats, _ = cv2.connectedComponentsWithStats(moving.astype(np.uint8), connectivity=8)
    ring = options.ring_outer
    for label in range(1, number):
        # Nothing farther than the ring beside a moving object plays a part.
        left, top, width, height, _ = stats[label]
        part = np.s_[max(top - ring, 0) : top + height + ring, max(left - ring, 0) : left + width + ring]
        moving_object = labels[part] == label
        bounds = (
            _ground(moving_object, sure[part], inverse[part], options),
            _occluded(moving_object, sure[part], occluding[part], inverse[part], options),
        )
        known = [one for one in bounds if one is not None]
        depth = max(known) if known else float(np.median(around[part][moving_object]))
        moving_object |= _without_holes(moving_object) & ((inverse[part] >= depth) | ~sure[part])
        sureness = options.moving_confidence if known else options.hovering_confidence * sure.any()
        inverse[part][moving_object], moving[part][moving_object] = depth, True
        confidence[part][moving_object] = sureness
    return inverse, confidence, moving


def _ground(moving_object: Mask, sure: Mask, inverse: Map, options: CompletionOptions) -> float | None:
    """The inverse depth that is seen below the lowest pixels of a moving object (h, w), None if too little
    is."""
    rows = np.nonzero(moving_object.any(axis=1))[0]
    foot = rows[-1] - round(options.foot_share * len(rows))
    below = np.zeros_like(moving_object)
    below[options.foot_offset :] = moving_object[: -options.foot_offset]
    below[:foot] = False
    found = inverse[below & ~moving_object & sure]
    enough = len(found) >= options.foot_offset
    return float(np.percentile(found, options.ground_percentile)) if enough else None


def _occluded(
    moving_object: Mask, sure: Mask, occluding: Mask, inverse: Map, options: CompletionOptions
) -> float | None:
    """The inverse depth of the nearest of what is beside a moving object (h, w) and hidden by it in a
    neighbour, or None."""
    away = cv2.distanceTransform((~_without_holes(moving_object)).astype(np.uint8), cv2.DIST_L2, 5)
    beside = (away > options.ring_inner) & (away <= options.ring_outer) & sure
    if np.count_nonzero(beside) < options.class_pixels:
        return None
    values, is_hidden = inverse[beside], occluding[beside]
    least, most = np.percentile(values, [1, 99])
    edges = np.linspace(least, most, options.ring_bins + 1)
    binned = (np.histogram(some, edges)[0] for some in (values, values[is_hidden]))
    count, hidden = (np.convolve(some, [1, 1, 1], "same") for some in binned)
    enough = count >= max(options.class_pixels, options.class_share * len(values))
    classes = np.nonzero(enough & (hidden > options.occluded_share * count))[0]
    if not len(classes):
        return None
    nearest = int(classes[-1])
    low, high = edges[max(nearest - 1, 0)], edges[min(nearest + 2, options.ring_bins)]
    return float(np.median(values[(values >= low) & (values <= high)]))


def _without_holes(moving_object: Mask) -> Mask:
    """A moving object (h, w) with its holes filled."""
    outside = np.pad((~moving_object).astype(np.uint8), 1, constant_values=1)
    cv2.floodFill(outside, None, (0, 0), 2)  # type: ignore[call-overload]
    return np.asarray(outside[1:-1, 1:-1] != 2)
