"""Depth that is steady in time: each frame's own, with that of frames around it brought into its place."""

from __future__ import annotations

from contextlib import nullcontext

import cv2
import numpy as np

from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint, part
from ..camera.reconstruction import Image, Reconstruction
from .multi_view_stereo import DenseDepth, PlaneSweepStereo, pixel_matrix
from .plane_sweep import Bytes, Map, Mask
from .view_selection import regular, relative_pose, stride

STEP, SIDES = 4, 3
"""Every fourth registered frame helps those around it, this many on either side. They are the same for frames
that follow each other: so each is found once, and what is unsure does not flicker."""
KEPT = 8
"""Frames whose own depth is remembered."""
FAINT = 0.02
"""Weight of what nothing is known of."""
LEVELS, ALIKE = 50, 1.5
"""Steps of the range of inverse depths; depths within so many of them are one surface."""
ENOUGH = 2
"""Sure frames that make sure."""
SURE = 0.1, 0.5
"""Confidence up to which depth is that of the surroundings, and from which on it is its own."""
REACH, CLOSE, EDGE = 4000.0, 50.0, 6.0
"""Of the smoother that spreads sure depth: its lambda, that within holes of what is sure, and the grey levels
that stop it."""
HOLE, AMONG = 0.02, (0.5, 0.7)
"""Of the long side, what is around a pixel in a hole, and the shares of depths of their own there below which
it is in none, and from which on it is."""
BEHIND, MOST = 4.0, 1.2
"""What is not sure beside something near is behind it: a power of depth as weight, and the largest ratio."""
EVEN = 15.0
"""Lambda of the smoother along the surfaces found; a level stops it."""
HIGH, RAMP, GROWS = 4.0, 2, 1.8
"""Levels that make a jump, pixels within which it is one, and how many times as high a slope is within twice
as many."""
NEAR, ALONE, AMID = 0.05, 0.6, 0.95
"""Of the long side, what is around a pixel; the shares of sure pixels there below which its depth must be
that of the others, and from which on it may be any,"""
STRANGE = 4.0
"""and levels by which it is another."""
RIM = 4
"""Pixels at the border that know too little around them."""


class TemporalFusion:
    """Depth of the frames of a clip, asked for in order. Memory is that of a few frames."""

    def __init__(self, reconstruction: Reconstruction, single: PlaneSweepStereo) -> None:
        self._rec, self._single = reconstruction, single
        self._kept = LRUCache[DenseDepth](KEPT)

    def at(self, frame: int) -> DenseDepth:
        """The depth of a frame, as `PlaneSweepStereo.at` and with its errors.

        The weighted median of all frames around, and the mean of those near it (Merrell et al., "Real-time
        visibility-based fusion of depth maps", 2007); where that is not sure, what is sure around it.
        """
        image, _ = self._rec.image_at(frame)
        around = self._around(frame)
        wanted = [frame, *(other.frame for other in around)]
        # What is remembered takes no time.
        new = [one for one in wanted if one not in self._kept]
        depths = []
        for one in wanted:
            with part(new.index(one), len(new)) if one in new else nullcontext():
                depths.append(self._alone(one))
        own, *depths = depths
        seen = []
        for depth, other in zip(depths, around, strict=True):
            checkpoint(1.0)
            seen.append(_seen(depth, other, own, image))
        stack = [(own.inverse_depth, _sure(own)), *seen]
        inverse, confidence, step = fused(*(np.stack(part) for part in zip(*stack, strict=True)))
        checkpoint(1.0)
        picture = self._single.picture(frame)
        confidence = _without_chance(picture, inverse, confidence, STRANGE * step)
        checkpoint(1.0)
        inverse, disputed = _filled(picture, inverse, confidence, ALIKE * step)
        checkpoint(1.0)
        inverse = sharpened(_evened(inverse, step), HIGH * step, disputed)
        inverse = np.where(own.moving, own.inverse_depth, inverse)
        confidence = np.where(own.moving, own.confidence, confidence)
        return DenseDepth(frame, inverse, confidence, own.moving, own.lens)

    def _around(self, frame: int) -> list[Image]:
        step = stride(self._rec, STEP)
        return regular(self._rec, frame, step, SIDES * step)

    def _alone(self, frame: int) -> DenseDepth:
        return self._kept.get(frame, lambda: self._single.at(frame))


def fused(inverse: Map, weight: Map) -> tuple[Map, Map, float]:
    """(h, w) of k inverse depths (k, h, w) and weights: value, confidence in it, and a level's height.

    Weights are confidences in [0, 1], and 0 where a frame does not see the place.
    """
    weight = np.where(weight > 0, weight + np.float32(FAINT), np.float32(0))
    total = weight.sum(axis=0)
    median = np.full(inverse.shape[1:], np.inf, np.float32)
    # So few are faster compared one with another than sorted.
    for value in inverse:
        checkpoint(1.0)
        enough = 2 * np.einsum("khw,khw->hw", weight, inverse <= value) >= total
        np.minimum(median, value, out=median, where=enough)
    low, high = np.percentile(median, [1, 99])
    step = float(high - low) / LEVELS
    agree = weight * (np.abs(inverse - median) <= np.float32(ALIKE * step))
    said = agree.sum(axis=0)
    mean = (agree * inverse).sum(axis=0) / np.maximum(said, 1e-9)
    share = np.clip(1.5 * said / np.maximum(total, 1e-9) - 0.25, 0, 1)
    confidence = np.clip(said / min(ENOUGH, len(inverse)), 0, 1) * share
    return np.where(said > 0, mean, median).astype(np.float32), confidence.astype(np.float32), step


def _sure(depth: DenseDepth) -> Map:
    """(h, w) confidence, a little everywhere but at the border."""
    sure = np.maximum(depth.confidence, np.float32(1e-3))
    inner = np.zeros(sure.shape, bool)
    inner[RIM:-RIM, RIM:-RIM] = True
    return np.where(inner, sure, np.float32(1e-3))


def _seen(depth: DenseDepth, image: Image, own: DenseDepth, here: Image) -> tuple[Map, Map]:
    """(h, w) inverse depth of another frame in a frame's place, the nearest of what falls into a pixel, and
    the confidence in it, 0 where nothing does."""
    turn, move = relative_pose(image, here)
    back = np.linalg.inv(pixel_matrix(depth.lens))
    rotate, shift = pixel_matrix(own.lens) @ turn @ back, pixel_matrix(own.lens) @ move
    height, width = depth.inverse_depth.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    places = [
        np.float32(r[0]) * x + np.float32(r[1]) * y + np.float32(r[2]) + np.float32(m) * depth.inverse_depth
        for r, m in zip(rotate, shift, strict=True)
    ]
    ahead = np.maximum(places[2], np.float32(0.05))
    column, row = (np.rint(part / ahead).clip(-1, 1 << 20).astype(np.int32) for part in places[:2])
    shape = own.inverse_depth.shape
    inside = (places[2] > 0.05) & (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])
    inside &= ~depth.moving
    value, weight = (depth.inverse_depth / ahead)[inside], _sure(depth)[inside]
    at = (row * shape[1] + column)[inside]
    inverse, confidence = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    np.maximum.at(inverse.ravel(), at, value)
    nearest = value == inverse.ravel()[at]
    confidence.ravel()[at[nearest]] = weight[nearest]
    return inverse, confidence


def _without_chance(picture: Bytes, inverse: Map, confidence: Map, strange: float) -> Map:
    """(h, w) confidence, little where depth is another than that of what is sure around, and little of that
    or the pixel itself is sure: what is found amid what cannot be found is mostly chance. Where most around
    is sure, what is as deep as its rim is no chance."""
    own = _own(confidence)
    share = _mean_around((confidence > SURE[0]).astype(np.float32), NEAR)
    free = np.clip((share - ALONE) / (AMID - ALONE), 0, 1) * own
    alike, as_rim = (
        np.exp(-(((inverse - _carried_on(picture, inverse, confidence, *how)) / max(strange, 1e-12)) ** 2))
        for how in ((REACH, BEHIND), (CLOSE, 0.0))
    )
    kept = confidence * (free + (1 - free) * alike)
    return np.asarray(np.maximum(kept, SURE[1] * _amid(own, NEAR) * as_rim), np.float32)


def _amid(own: Map, size: float) -> Map:
    """(h, w) how far each pixel has such with depths of their own on most sides, within `size`."""
    return np.asarray(np.clip((_mean_around(own, size) - AMONG[0]) / (AMONG[1] - AMONG[0]), 0, 1), np.float32)


def _mean_around(values: Map, size: float) -> Map:
    """(h, w) in a square around each pixel, whose side is a share of the long one; but not at the border."""
    around = 2 * (int(size * max(values.shape)) // 2) + 1
    inner = np.zeros(values.shape, np.float32)
    inner[RIM:-RIM, RIM:-RIM] = 1
    total, known = (
        cv2.blur(part, (around, around), borderType=cv2.BORDER_CONSTANT) for part in (inner * values, inner)
    )
    return np.asarray(total / np.maximum(known, 1e-6), np.float32)


def _filled(picture: Bytes, inverse: Map, confidence: Map, alike: float) -> tuple[Map, Mask]:
    """Inverse depth (h, w) where it is sure, elsewhere carried on along a picture's (h, w, 3) surfaces.

    Holes in what is sure get that of their rims: what reaches far mixes in other surfaces where the picture's
    edges are faint. Depths more than `alike` apart are two surfaces', and a pixel gets one of them.
    """
    far, close = (_carried_on(picture, inverse, confidence, reach) for reach in (REACH, CLOSE))
    own = _own(confidence)
    amid = _amid(own, HOLE)
    around = amid * close + (1 - amid) * far
    disputed = (np.abs(inverse - around) > alike) & (own < 1)
    own = np.where(disputed, own > 0.5, own)
    return np.asarray(np.maximum(own * inverse + (1 - own) * around, 0), np.float32), disputed


def _own(confidence: Map) -> Map:
    """(h, w) share that a pixel's own depth has in what it gets."""
    return np.asarray(np.clip((confidence - SURE[0]) / (SURE[1] - SURE[0]), 0, 1), np.float32)


def _carried_on(picture: Bytes, inverse: Map, confidence: Map, reach: float, behind: float = BEHIND) -> Map:
    """(h, w) the sure inverse depth along a picture's (h, w, 3) surfaces; `behind` as `BEHIND`."""
    usual = float(np.median(inverse)) or 1.0
    nearness = np.maximum(inverse, 1e-6) / usual
    weight = np.clip((confidence - SURE[0]) / (1 - SURE[0]), 0, 1) ** 2
    weight *= np.minimum(1 / nearness, MOST) ** behind
    above, below = (
        cv2.ximgproc.fastGlobalSmootherFilter(picture, np.ascontiguousarray(part, np.float32), reach, EDGE)
        for part in (weight * (nearness - 1), weight)
    )
    return np.asarray(usual * (1 + above / (np.maximum(below, 0) + 1e-7)), np.float32)


def _evened(inverse: Map, step: float) -> Map:
    """Inverse depth (h, w) smooth along surfaces, whose edges are where it changes by a level or more."""
    low, high = float(inverse.min()), float(inverse.max())
    if step <= 0 or high <= low:
        return inverse
    scale = min(4 / step, 255 / (high - low))
    guide = ((inverse - low) * scale).astype(np.uint8)
    return np.asarray(cv2.ximgproc.fastGlobalSmootherFilter(guide, inverse, EVEN, scale * step), np.float32)


def sharpened(inverse: Map, high: float, disputed: Mask | bool = False) -> Map:
    """Inverse depth (h, w) whose jumps of more than `high` are steps.

    Matching leaves ramps and shelves at silhouettes, which no surface is at: their pixels join the nearer end
    in depth (Kramer and Bruckner, "Iterations of a non-linear transformation for enhancement of digital
    images", 1975). A slope goes on beyond, and stays. Where depth is `disputed` (h, w) nothing is a slope,
    and ends are looked for twice as far.
    """
    near, wide = (np.ones((2 * reach + 1, 2 * reach + 1), np.uint8) for reach in (RAMP, 2 * RAMP))
    # Single wrong pixels are no end of a ramp.
    ends = cv2.medianBlur(inverse, 3)
    low, top = cv2.erode(ends, near), cv2.dilate(ends, near)
    lowest, highest = cv2.erode(ends, wide), cv2.dilate(ends, wide)
    ramp = (top - low > high) & (highest - lowest < GROWS * (top - low))
    loose = disputed & (highest - lowest > high)
    low, top = np.where(loose, lowest, low), np.where(loose, highest, top)
    nearer = np.where(top - inverse < inverse - low, top, low)
    return np.where(ramp | loose, nearer, inverse).astype(np.float32)
