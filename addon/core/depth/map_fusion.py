"""Depth maps of several frames in one frame's place, fused, and filled where they know nothing."""

from dataclasses import dataclass

import cv2
import numpy as np

from ..base import nearest_fill
from ..base.arrays import Bytes, Map, Mask
from ..base.global_smoother import globally_smoothed
from ..base.progress import checkpoint
from .completion import SMOOTHER_SIGMA
from .source import SURE as UNSURE
from .source import extended

TINY = float(np.finfo(np.float32).tiny)
"""Smallest normal number of single precision, against division by zero, in any unit."""
LEAST_FRAMES = 8
"""Frames of a short clip that may help, even if that needs a smaller step. Chosen by inspection."""
LEAST_WEIGHT = 0.02
"""Weight, against 1, of a depth of which nothing is sure. Chosen by inspection."""
LEVELS = 50
"""Levels in the range of inverse depths. Chosen by inspection, about as many as the sweep has."""
SAME_SURFACE = 1.5
"""Levels within which depths are one surface. Chosen by inspection."""
SURE_FRAMES = 2
"""Sum of confidences that agree with which a depth is sure. Chosen by inspection."""
SURE = 0.5
"""Confidence from which on a pixel's depth is its own. Chosen by inspection."""
FAR_LAMBDA = 4000.0
"""Lambda of the fast global smoother that extrapolates sure depth. Chosen by inspection."""
HOLE_LAMBDA = 50.0
"""Lambda of the smoother within holes of sure depth: with it fence has 34.04 instead of 33.93 dB (32 px, from
the video alone) and a fifth to a third fewer triangles."""
HOLE_WINDOW = 0.02
"""Share of the long side around a pixel in a hole. With 0.04 fence has 34.14 instead of 34.19 dB, and a hole
is left in the duck's frame 107."""
HOLE_SHARE = (0.5, 0.7)
"""Shares of own depths around a pixel below which it is in no hole, and from which on it is. Chosen by
inspection."""
BESIDE_MOVING = 0.03
"""Share of the long side from moving pixels within which depth is extrapolated as in holes. Beside a person
whom the camera follows, uncertain depth is 10 to 15 of 960 pixels wide."""
BEHIND_POWER = 4.0
"""Unsure pixels beside something near are behind it: weight is depth to this power. Chosen by inspection."""
BEHIND_RATIO = 1.2
"""Depths, against the median, beyond which that weight grows no more. Chosen by inspection."""
EVEN_LAMBDA = 15.0
"""Lambda of the smoother along the surfaces found, which a level stops. Chosen by inspection."""
JUMP = 4.0
"""Levels within `RAMP` pixels that make a jump of a ramp. Chosen by inspection."""
STEPS_OF_LEVEL = 16
"""Steps of a level in which islands are compared, as whole numbers."""
LARGEST_SPECKLE = 6
"""Pixels of a hole in a surface that are too few for their texture to prove it. Chosen by inspection."""
LARGEST_ISLAND = 1e-3
"""Share of the picture of an island that may be an error."""
ISLAND_JUMP, ISLAND_DOUBT = 8.0, 0.6
"""Levels by which an island is nearer than its surroundings, and mean confidence below which it is an error.
In a street at night these limits remove 25 sharp specks of 10 to 470 pixels a frame; their confidence is 0.3
to 0.55."""
RAMP = 2
"""Pixels within which such a jump is one. Chosen by inspection."""
SLOPE_RATIO = 1.8
"""Times as high as within `RAMP` pixels that a slope is within twice as many, a jump not. Chosen by
inspection."""
OUTLIER_WINDOW = 0.05
"""Side of the square, as a share of the long side, whose depths decide whether that of its middle pixel is an
outlier. Chosen by inspection."""
OUTLIER_SHARES = (0.6, 0.95)
"""Shares of sure pixels there below which its depth must be that of the others, and from which on it may be
any. Chosen by inspection, on the duck's frame 60: its mesh has 4.6 instead of 10.4 % of the grid's
triangles."""
OUTLIER = 4.0
"""Levels from the others at which a depth is an outlier. Chosen by inspection."""
LEAST_NEARNESS = 1e-6
"""Inverse depth relative to the median, below which things are nearly at infinity. Chosen by inspection."""
BORDER = 4
"""Pixels at the border that know too little around them. Chosen by inspection."""
BEYOND = 0.1
"""Share of the long side by which depth reaches past the border, enough for a disc of twice this share."""


@dataclass(frozen=True)
class FusionOptions:
    """Fusion of frames and the fill where they know nothing.

    Depths are compared in levels: 1 / `LEVELS` of the range of inverse depths, from the 1st to the 99th
    percentile.
    """

    step: int = 4
    """Registered frames from one key frame to the next. Neighbours share key frames: each is found once, and
    unsure pixels do not flicker. Chosen by inspection."""
    most_unseen: float = 0.02
    """Share of a frame that no key frame may see, beyond which it is swept itself, as with less than 0 every
    frame is. Chosen by inspection."""
    sides: int = 3
    """Frames that help on either side. Chosen by inspection."""


KEPT_FRAMES = 2 * FusionOptions.sides + 2
"""Frames whose own depth is remembered: those on both sides and two more."""


def fused(
    inverse: Map, weight: Map, nearest: Map | None = None, level: float | None = None
) -> tuple[Map, Map, float]:
    """Fuse inverse depths of several frames.

    Args:
        inverse: (k, h, w).
        weight: (k, h, w) confidence in [0, 1], 0 where a frame does not see the place.
        nearest: (k, h, w) largest inverse depth at which each frame would see something there; nearer things
            are not contradicted by frames that look past them. Unbounded without it.
        level: Height of a level; estimated without it.

    Returns:
        Inverse depth (h, w), its confidence (h, w), and the height of a level.
    """
    weight = np.where(weight > 0, weight + np.float32(LEAST_WEIGHT), np.float32(0))
    median, total = inverse.min(axis=0), weight.sum(axis=0)
    # So few are faster compared one with another than sorted.
    for value in inverse:
        checkpoint(1.0)
        behind = inverse < value
        before = np.einsum("khw,khw->hw", weight, ~behind)
        if nearest is not None:
            behind &= nearest >= value
        against = np.einsum("khw,khw->hw", weight, behind)
        enough = (before > against) & (value >= median)
        np.copyto(median, value, where=enough)
        np.copyto(total, before + against, where=enough)
    if level is None:
        level = level_of(median)
    agree = weight * (np.abs(inverse - median) <= np.float32(SAME_SURFACE * level))
    agreed = agree.sum(axis=0)
    mean = (agree * inverse).sum(axis=0) / np.maximum(agreed, 1e-9)
    share = np.clip(1.5 * agreed / np.maximum(total, 1e-9) - 0.25, 0, 1)
    confidence = np.clip(agreed / min(SURE_FRAMES, len(inverse)), 0, 1) * share
    return np.where(agreed > 0, mean, median).astype(np.float32), confidence.astype(np.float32), level


def level_of(inverse: Map) -> float:
    """Height of a level of inverse depths (h, w)."""
    low, high = np.percentile(inverse, [1, 99])
    return float(high - low) / LEVELS


def past_border(stack: list[tuple[Map, Map, Map]], inside: Map, level: float) -> Map:
    """Return the inverse depth (h + 2 m, w + 2 m) around a frame, NaN within and where it is unknown.

    It is that of the `stack` of `in_place` of other frames, with a margin of m pixels, around the frame's own
    inverse depth `inside` (h, w), in levels of a height.
    """
    past = np.full(stack[0][0].shape, np.nan, np.float32)
    margin = (past.shape[0] - inside.shape[0]) // 2
    outside = np.ones(past.shape, bool)
    outside[margin:-margin, margin:-margin] = False
    at = np.flatnonzero(outside & (np.maximum.reduce([weight for _, weight, _ in stack]) > 0))
    if not len(at):
        return past
    inverses, weights, nearest = (
        np.stack([each.ravel()[at] for each in part])[:, None] for part in zip(*stack, strict=True)
    )
    inverse, confidence, _ = fused(inverses, weights, nearest, level)
    past.ravel()[at] = np.where(confidence[0] > UNSURE, inverse[0], np.float32(np.nan))
    # Gaps between known pixels belong to the background, and a few single pixels are noise.
    around = np.ones((5, 5), np.uint8)
    known = (~np.isnan(past)).astype(np.uint8)
    known[~outside] = 1
    dense = cv2.morphologyEx(cv2.morphologyEx(known, cv2.MORPH_CLOSE, around), cv2.MORPH_OPEN, around)
    wide = extended(inside, past, margin)
    behind = cv2.erode(np.where(known > 0, wide, np.float32(np.inf)), around)
    wide = np.where((known == 0) & (behind <= wide.max()), behind, wide)
    wide = sharpened(cv2.medianBlur(wide, 5), level)
    return np.where(outside & (dense > 0), wide, np.float32(np.nan))


def without_outliers(picture: Bytes, inverse: Map, confidence: Map, level: float) -> Map:
    """Return the confidence (h, w) without outliers.

    A depth that differs from sure depths around it, in a region with few of them, is mostly chance. Where
    most pixels around are sure, a depth equal to that of the rim is kept.
    """
    own, (low, high) = _own_share(confidence), OUTLIER_SHARES
    sure = (confidence > UNSURE).astype(np.float32)
    share = _mean_around(sure, OUTLIER_WINDOW)
    free = np.clip((share - low) / (high - low), 0, 1) * own
    # Where almost all is one depth there are no levels, and whatever is another one is an outlier.
    outlier = max(OUTLIER * level, TINY)
    surroundings = _extrapolated(picture, inverse, confidence, FAR_LAMBDA, BEHIND_POWER)
    rim = _extrapolated(picture, inverse, confidence, HOLE_LAMBDA, 0.0)
    with np.errstate(over="ignore"):
        off = ((inverse - np.stack([surroundings, rim])) / outlier) ** 2
    as_surroundings, as_rim = np.exp(-off)
    kept = confidence * (free + (1 - free) * as_surroundings)
    in_hole = _in_hole(own, OUTLIER_WINDOW)
    return np.asarray(np.maximum(kept, SURE * in_hole * as_rim), np.float32)


def _in_hole(own: Map, window: float) -> Map:
    """(h, w) how far each pixel is surrounded by known depths, within a window (share of the long side)."""
    low, high = HOLE_SHARE
    return np.asarray(np.clip((_mean_around(own, window) - low) / (high - low), 0, 1), np.float32)


def _mean_around(values: Map, window: float) -> Map:
    """(h, w) mean over a square whose side is a share of the long one, without the border's pixels."""
    around = 2 * (int(window * max(values.shape)) // 2) + 1
    inner = np.zeros(values.shape, np.float32)
    inner[BORDER:-BORDER, BORDER:-BORDER] = 1
    total, known = (
        cv2.blur(part, (around, around), borderType=cv2.BORDER_CONSTANT) for part in (inner * values, inner)
    )
    return np.asarray(total / np.maximum(known, 1e-6), np.float32)


def filled(picture: Bytes, inverse: Map, confidence: Map, level: float, moving: Mask) -> tuple[Map, Mask]:
    """Return inverse depth (h, w) extrapolated from sure pixels, and the pixels (h, w) of disagreement.

    Extrapolation follows the surfaces of a picture (h, w, 3). Holes in sure depth get the depth of their
    rims: a longer reach mixes in other surfaces where the picture's edges are faint. Depths too far apart
    belong to two surfaces, and a pixel gets one of them. Pixels near those that are `moving` (h, w) count as
    a hole: beside a person that the camera follows, the road is known on one side only, and depths from far
    away would be those of its other end.
    """
    far, close = (
        _extrapolated(picture, inverse, confidence, reach, BEHIND_POWER)
        for reach in (FAR_LAMBDA, HOLE_LAMBDA)
    )
    own = _own_share(confidence)
    reach = 2 * int(BESIDE_MOVING * max(inverse.shape)) + 1
    beside = cv2.dilate(moving.astype(np.float32), np.ones((reach, reach), np.uint8))
    in_hole = np.maximum(_in_hole(own, HOLE_WINDOW), beside)
    around = in_hole * close + (1 - in_hole) * far
    disputed = (np.abs(inverse - around) > SAME_SURFACE * level) & (own < 1)
    own = np.where(disputed, own > 0.5, own)
    return np.asarray(np.maximum(own * inverse + (1 - own) * around, 0), np.float32), disputed


def _own_share(confidence: Map) -> Map:
    """(h, w) weight of a pixel's own depth in its result."""
    return np.asarray(np.clip((confidence - UNSURE) / (SURE - UNSURE), 0, 1), np.float32)


def _extrapolated(picture: Bytes, inverse: Map, confidence: Map, reach: float, behind: float) -> Map:
    """(h, w) sure inverse depth, extended by weighted least squares along surfaces (Min et al., 2014)."""
    median = float(np.median(inverse)) or 1.0
    nearness = np.maximum(inverse / median, LEAST_NEARNESS)
    weight = np.clip((confidence - UNSURE) / (1 - UNSURE), 0, 1) ** 2
    weight *= np.minimum(1 / nearness, BEHIND_RATIO) ** behind
    above, below = (
        globally_smoothed(picture, part, reach, SMOOTHER_SIGMA) for part in (weight * (nearness - 1), weight)
    )
    return np.asarray(median * (1 + above / (np.maximum(below, 0) + 1e-7)), np.float32)


def even(inverse: Map, level: float) -> Map:
    """Return inverse depth (h, w) smoothed along surfaces, which end at changes of a level or more."""
    low, high = float(inverse.min()), float(inverse.max())
    if level <= 0 or high <= low:
        return inverse
    scale = min(4 / level, 255 / (high - low))
    return globally_smoothed(((inverse - low) * scale).astype(np.uint8), inverse, EVEN_LAMBDA, scale * level)


def sharpened(inverse: Map, level: float, disputed: Mask | bool = False, ramp: int = RAMP) -> Map:
    """Inverse depth (h, w) whose jumps of several levels are steps.

    Matching leaves ramps and shelves at silhouettes, which no surface is at: their pixels join the nearer end
    in depth (Kramer and Bruckner, "Iterations of a non-linear transformation for enhancement of digital
    images", 1975). A slope goes on beyond, and stays. Where depth is `disputed` (h, w) nothing is a slope,
    and ends are looked for twice as far. `ramp` is in pixels, as `RAMP`.
    """
    jump = JUMP * level
    near, wide = (np.ones((2 * reach + 1, 2 * reach + 1), np.uint8) for reach in (ramp, 2 * ramp))
    # Single wrong pixels are no end of a ramp.
    ends = cv2.medianBlur(inverse, 3)
    low, high = cv2.erode(ends, near), cv2.dilate(ends, near)
    lowest, highest = cv2.erode(ends, wide), cv2.dilate(ends, wide)
    is_ramp = (high - low > jump) & (highest - lowest < SLOPE_RATIO * (high - low))
    loose = disputed & (highest - lowest > jump)
    low, high = np.where(loose, lowest, low), np.where(loose, highest, high)
    nearer = np.where(high - inverse < inverse - low, high, low)
    return np.where(is_ramp | loose, nearer, inverse).astype(np.float32)


def without_speckles(inverse: Map, level: float) -> Map:
    """Return inverse depth (h, w) with holes of a few pixels in a surface filled from their rims."""
    rim = cv2.morphologyEx(inverse, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    deep = rim - inverse > JUMP * level
    _, label, found, _ = cv2.connectedComponentsWithStats(deep.astype(np.uint8), connectivity=8)
    is_speckle = deep & (found[:, cv2.CC_STAT_AREA] <= LARGEST_SPECKLE)[label]
    return np.where(is_speckle, rim, inverse).astype(np.float32)


def without_islands(inverse: Map, confidence: Map, level: float) -> Map:
    """Remove small near islands without much evidence, which are sharp specks in a blurred background.

    The islands of the inverse depth (h, w), of a confidence (h, w) in [0, 1], get that of the nearest pixel
    around them.
    """
    if level <= TINY:
        return inverse
    steps = np.clip(np.rint(STEPS_OF_LEVEL / level * inverse), 0, np.iinfo(np.int16).max - 1).astype(np.int16)
    small = int(LARGEST_ISLAND * inverse.size)
    cv2.filterSpeckles(steps, -1, small, int(JUMP / 2 * STEPS_OF_LEVEL))
    island = steps < 0
    if not island.any() or island.all():
        return inverse
    around = nearest_fill.nearest(inverse, ~island)
    count, label = cv2.connectedComponents(island.astype(np.uint8), connectivity=8)
    area = np.bincount(label.ravel(), minlength=count)
    nearer, sure = (
        np.bincount(label.ravel(), part.ravel(), count) / area for part in (inverse - around, confidence)
    )
    wrong = (nearer > ISLAND_JUMP * level) & (sure < ISLAND_DOUBT)
    wrong[0] = False
    return np.where(wrong[label], around, inverse).astype(np.float32)
