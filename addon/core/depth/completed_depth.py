"""Depth of the clip itself, completed by given maps.

Stereo decides where it is sure. On plain walls, gloss, or moving objects it is not; a map has their shape,
but not their position: it bends and drifts. There the map is used, tied to the sure depth around it.
"""

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import Map
from .map_fusion import SAME_SURFACE, SURE, level_of, sharpened
from .multi_view_stereo import DenseDepth
from .source import SURE as UNSURE

REACHES = (0.6, 0.06)
"""Standard deviations of the windows in which a map is shifted, as shares of the long side. Chosen by
inspection, and checked with `benchmarks.special completed` at 66cd1dc7."""
SPARSE = 0.02
"""Sure share of a window at which its shift has half of its weight. Chosen by inspection."""
GRID = 4
"""Pixels that a window's sums are made at: the smallest window has several times as many."""
MISS = 3.0
"""Levels from the map at which sure depth loses half of its weight."""
ROUNDS = 4
"""Shifts, each with the weights of the one before."""
SOFT = 0.008
"""Share of the long side by which a map's edges are soft."""
SHARP = 0.7
"""Share of a map's change within this distance that lies between neighbours at a hard edge: maps like
a network's have 0.3, a rendered map 1. Chosen by inspection."""
AROUND = 0.02
"""Standard deviation of the surroundings of a pixel, as a share of the long side."""
BELIEVED = (0.5, 0.9)
"""Shares of sure depth around below which depth that contradicts the map is none, and from which on it is
believed: of a phone's room, 0.1 to 0.6 around what is wrong and 0.5 to 1 around what is right; of the
bench's scenes 0.7 to 1."""
CONTRADICTION = 5.0
"""Levels between map and stereo at which most of a contradiction is real. Chosen by inspection."""


def tied(inverse: Map, sure: Map, given: Map, level: float) -> Map:
    """Return a map's inverse depth (h, w), shifted to sure depth around each pixel.

    `inverse` (h, w) has the weights `sure` (h, w) in [0, 1], `given` (h, w) is the map's inverse depth, and
    `level` a hardly visible step.
    """
    off, change = inverse - given, np.zeros_like(given)
    for _ in range(ROUNDS):
        near = 1 / (1 + ((off - change) / (MISS * level)) ** 2)
        change = _shift(off, sure * (near * near).astype(np.float32))
    return stepped(np.maximum(given + change, 0).astype(np.float32), level)


def stepped(given: Map, level: float) -> Map:
    """Return a map's inverse depths (h, w) with steps in place of soft edges.

    The filter is applied repeatedly, like that of Kramer and Bruckner: of three surfaces, the middle one
    stays where it is wide enough to be flat. Steps of more than a few levels are hard already.
    """
    # A map is soft within so many pixels from an edge.
    reach, kernel = max(int(SOFT * max(given.shape)), 1), np.ones((3, 3), np.uint8)
    around = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    rise, most = (cv2.dilate(given, each) - cv2.erode(given, each) for each in (kernel, around))
    is_soft = sharpened(given, level, ramp=reach) != given
    is_soft &= cv2.dilate(rise, around) <= SHARP * most
    steps = given
    for _ in range(2 * reach):
        low, high = cv2.erode(steps, kernel), cv2.dilate(steps, kernel)
        steps = np.where(is_soft, np.where(high - steps < steps - low, high, low), steps)
    return np.asarray(steps, np.float32)


def _shift(off: Map, weight: Map) -> Map:
    """(h, w) weighted mean of `off` in windows; smaller ones have what larger ones leave."""
    size = max(off.shape[1] // GRID, 1), max(off.shape[0] // GRID, 1)
    small, weight = (cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (off * weight, weight))
    found = np.zeros_like(small)
    for reach in REACHES:
        left, known = (
            cv2.GaussianBlur(part, (0, 0), reach * max(size), borderType=cv2.BORDER_REFLECT)
            for part in (small - weight * found, weight)
        )
        found = found + left / (known + np.float32(SPARSE))
    return np.asarray(cv2.resize(found, off.shape[::-1]), np.float32)


def completed(depth: DenseDepth, given: Map) -> DenseDepth:
    """Return depth from stereo, with the shape of a map `given` (h, w) in unsure pixels."""
    inverse = depth.inverse_depth
    level = max(level_of(inverse), level_of(given))
    if level <= 0:
        return depth
    own = np.clip((depth.confidence - UNSURE) / (SURE - UNSURE), 0, 1)
    own = np.where(depth.moving, np.float32(0), own).astype(np.float32)
    # Where little is sure, what seems so is mostly chance, and does not outweigh a map that it contradicts.
    around = cv2.GaussianBlur(own, (0, 0), AROUND * max(own.shape))
    low, high = BELIEVED
    dense = np.clip((around - low) / (high - low), 0, 1)
    shape = tied(inverse, own * dense, given, level)
    contradicts = 1 - np.exp(-(((shape - inverse) / (CONTRADICTION * level)) ** 2))
    own = (own * (1 - contradicts * (1 - dense))).astype(np.float32)
    share = 1 - own
    # Depths too far apart are two surfaces', and a pixel gets one of them.
    apart = np.abs(shape - inverse) > SAME_SURFACE * level
    share = np.where(apart, share > 0.5, share).astype(np.float32)
    confidence = np.maximum(depth.confidence, SURE * share).astype(np.float32)
    whole = (share * shape + (1 - share) * inverse).astype(np.float32)
    return replace(depth, inverse_depth=whole, confidence=confidence)
