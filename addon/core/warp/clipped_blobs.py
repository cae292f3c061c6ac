"""Small clipped blobs of a picture, possible light sources, and their surroundings, for `highlights`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import erf

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, Ints, LinearRGBA, Map, Mask
from ..base.progress import checkpoint

LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Channel weights of BT.709's luma, by which clips are coded: chroma has half of its resolution."""
NEAR = 1.5
"""Standard deviation in pixels of the weights that estimate a blob's background. Chosen by inspection."""
PAD = 5
"""Pixels of surroundings around a blob."""
EDGE_CONTRAST = 0.15
"""Least contrast in linear light of an edge that measures the point spread."""
EDGE_SHARE = 85.0
"""Percentile of edges by sharpness: 0.42 px on bars, whose true filter has 0.42."""
FEWEST_EDGES = 100
"""Least edges that measure the point spread; with fewer it is `SPREAD`."""
SPREAD = 0.42
"""Default point spread: standard deviation in pixels. Larger than the true one makes lamps too bright."""
SPREADS = (0.38, 1.5)
"""Bounds of the point spread."""
SIZE = 0.02
"""Root of a blob's area as a share of the long side up to which it may be a light source; from twice as much
on it is a sky, wall, window or sheet of paper. Chosen by inspection."""
LENGTH = 0.1
"""The same for a blob's length. Chosen by inspection."""
AMONG = (0.0, 0.25)
"""Share of large clipped areas around, from none to that of sky in leaves. Chosen by inspection."""
AROUND = 0.02
"""Reach of these surroundings as a share of the long side. Chosen by inspection."""
GROUND = 0.4
"""Linear light of the surroundings up to which a blob may be a light source; from twice as much on it is
noise on a white surface. Chosen by inspection."""
FLAT = (0.012, 0.022)
"""Mean linear light of a blob over the threshold: from the second on its pixels are clipped but for noise, up
to the first they are nearly white paint, as in walk and fence (otherwise 0.7 and 0.3 dB less)."""
NEARLY = 0.92
"""Least value of a blob's pixels as a share of the threshold: coded clips have clipped pixels a little under
white, 247 to 254 of 255 in H.264 at a rate factor of 20."""
LOW, WHITES = 10.0, (0.85, 1.0)
"""Percentile of the values within blobs above which all pixels are clipped, and its bounds."""
MOST = 4096
"""Most blobs of a picture, the largest: three times those of a night street at 1280x720, and as many as
touching discs that are 15 pixels wide."""
USED = 3
"""Pixels around a blob that are compared with the model."""
ALIKE = 2
"""Sides of patches in pixels are multiples of it, so that many are processed together."""


@dataclass(frozen=True)
class Blobs:
    """The n small clipped blobs of a picture that may be light sources."""

    centre: Floats
    """(n, 2) x and y as shares of the picture's width and height."""
    area: Floats
    """(n,) clipped pixels."""
    weight: Floats
    """(n,) confidence in [0, 1] that it is a light source and not a piece of a large clipped area."""
    spread: float
    """Standard deviation of the picture's point spread in pixels."""
    white: float
    """Linear light above which a pixel is clipped: lower in coded clips, whose clipped pixels vary."""
    patches: tuple[Patches, ...]
    """Their surroundings, grouped by size."""

    def __len__(self) -> int:
        return len(self.area)


@dataclass(frozen=True)
class Patches:
    """Surroundings (h, w) of k blobs, at least `USED` pixels wide; the picture's border repeats."""

    number: Indices
    """(k,) index of the blob in the picture."""
    pixel: Indices
    """(k, h, w) index of the pixel in the picture, row by row."""
    light: Map
    """(k, 3, h, w) linear."""
    ground: Map
    """(k, 3, h, w) linear colour of the background, estimated from the surroundings."""
    own: Mask
    """(k, h, w) the blob's pixels, also past the border."""
    seen: Mask
    """(k, h, w) the blob's pixels in the picture."""
    beside: Mask
    """(k, h, w) the blob's rim."""
    used: Mask
    """(k, h, w) pixels to compare: the blob's, and those around it that no other blob reaches."""
    core: Floats
    """(k, 3) median linear colour of its clipped pixels."""
    rim: Floats
    """(k, 3) linear light of its rim above the background, summed."""
    doubt: Floats
    """(k,) standard deviation of `rim` in a channel, due to the background's texture."""
    texture: Floats
    """(k,) mean square difference of surroundings and background, of square roots of linear light."""

    def __len__(self) -> int:
        return len(self.number)

    def among(self, which: Mask | Indices | slice) -> Patches:
        """Select some of the patches."""
        return Patches(*(value[which] for value in vars(self).values()))


def clipped_blobs(picture: LinearRGBA, threshold: float) -> Blobs:
    """Find the small clipped blobs of a linear picture (H, W, 3 or 4), at most `MOST`; passes checkpoints.

    They are connected pixels with a channel of nearly `threshold` of white, and one pixel above it. Blobs
    without weight are left out.
    """
    peak = brightest(picture)
    clipped = peak >= NEARLY * threshold
    if not (peak >= threshold).any():
        return Blobs(np.zeros((0, 2)), np.zeros(0), np.zeros(0), SPREAD, 1.0, ())
    _, label, stats, centres = cv2.connectedComponentsWithStats(clipped.astype(np.uint8), connectivity=8)
    weight = _weights(peak, clipped, label, stats, threshold)
    numbers = np.flatnonzero(weight > 0)
    # In the order of their area, the largest first.
    numbers = np.sort(numbers[np.argsort(-stats[numbers, cv2.CC_STAT_AREA], kind="stable")[:MOST]])
    spread = point_spread(picture) if len(numbers) else SPREAD
    sides = PAD + stats[numbers][:, [cv2.CC_STAT_HEIGHT, cv2.CC_STAT_WIDTH]] + PAD
    sides = ALIKE * -(-sides // ALIKE)
    found, sure = [], np.zeros(len(weight))
    for size in np.unique(sides, axis=0):
        checkpoint()
        some = numbers[(sides == size).all(axis=1)]
        made, ground = _patches(picture, label, stats, some, (int(size[0]), int(size[1])))
        sure[some] = weight[some] * _falling(ground, GROUND, 2 * GROUND)
        found.append(made.among(sure[some] > 0))
    kept = np.flatnonzero(sure > 0)
    renamed = np.zeros(len(weight), np.intp)
    renamed[kept] = np.arange(len(kept))
    patches = tuple(replace(each, number=renamed[each.number]) for each in found if len(each))
    centre = (centres[kept] + 0.5) / peak.shape[::-1]
    within = (cv2.erode(clipped.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & (sure > 0)[label]
    white = float(np.clip(np.percentile(peak[within], LOW), *WHITES)) if within.any() else 1.0
    return Blobs(centre, stats[kept, cv2.CC_STAT_AREA].astype(np.float64), sure[kept], spread, white, patches)


def _weights(peak: Map, clipped: Mask, label: Ints, stats: Ints, threshold: float) -> Floats:
    """Return the (n,) confidence of components as light sources, without regard to their background."""
    long_side = max(peak.shape)
    row, column = np.nonzero(clipped)
    of, count = label[row, column], len(stats)
    value = np.minimum(peak[row, column], 1)
    most = value >= threshold
    full = np.bincount(of, most, count)
    level = np.bincount(of, np.where(most, value, 0), count) / np.maximum(full, 1)
    # Not by its thickness: print and grain perforate paper.
    size = np.sqrt(stats[:, cv2.CC_STAT_AREA]) / long_side
    is_large = size > 2 * SIZE
    is_large[0] = False
    among = np.zeros(count)
    if is_large.any():
        reach = 2 * round(AROUND * long_side) + 1
        around = cv2.boxFilter(is_large[label].astype(np.float32), -1, (reach, reach))
        among = np.bincount(of, around[row, column], count) / np.maximum(stats[:, cv2.CC_STAT_AREA], 1)
    length = stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1)
    flat = (min(threshold + each, 1 - 1e-3 / (1 + n)) for n, each in enumerate(FLAT))
    weight = (
        _falling(size, SIZE, 2 * SIZE)
        * _falling(length / long_side, LENGTH, 2 * LENGTH)
        * _falling(among, *AMONG)
        * (1 - _falling(level, *flat))
        * (full > 0)
    )
    weight[0] = 0
    return np.asarray(weight, np.float64)


def _patches(
    picture: LinearRGBA, label: Ints, stats: Ints, numbers: Indices, size: tuple[int, int]
) -> tuple[Patches, Floats]:
    """Cut out components (k,) with surroundings (h, w); also return their backgrounds' light (k,)."""
    height, width = label.shape
    x, y, across, down = (stats[numbers, each][:, None] for each in range(4))
    places, inside = [], []
    for side, first, extent, limit in zip(size, (y, x), (down, across), (height, width), strict=True):
        place = first - PAD + np.arange(side)
        inside.append((place >= 0) & (place < limit) & (place < first + extent + PAD))
        places.append(np.clip(place, 0, limit - 1))
    valid = inside[0][:, :, None] & inside[1][:, None]
    pixel = places[0][:, :, None] * width + places[1][:, None]
    light = np.moveaxis(picture.reshape(height * width, -1)[pixel], -1, 1)[:, :3]
    labels = label.ravel()[pixel]
    own = labels == numbers[:, None, None]
    away, clear = _distances(own), _distances((labels > 0) & ~own & valid)
    ring = (away > 1.5) & (away <= 4.6) & (clear > 2.3) & valid
    # Between other blobs, any pixel without a blob.
    ring |= (away > 1.5) & (labels == 0) & valid & ~ring.any(axis=(1, 2), keepdims=True)
    ground = _ground(light, ring)
    level = _medians(ground.max(axis=1)[:, None], own & valid)[:, 0]
    level[~ring.any(axis=(1, 2))] = np.inf
    texture, spread = _around(light, ground, ring)
    apart = (clear > 1.5) & valid
    beside = (away > 0) & (away <= 1.5) & apart
    rim = np.where(beside[:, None], light - ground, 0).sum(axis=(2, 3), dtype=np.float64)
    # The nearest background is one patch of its texture: the whole rim may share its error.
    doubt = spread * beside.sum(axis=(1, 2))
    used = (away <= USED) & apart
    seen = own & valid
    inner = np.s_[..., PAD - USED : USED - PAD, PAD - USED : USED - PAD]
    made = Patches(
        numbers, pixel[inner], np.ascontiguousarray(light[inner]), np.ascontiguousarray(ground[inner]),
        own[inner], seen[inner], beside[inner], used[inner], _medians(light, seen), np.maximum(rim, 0),
        doubt, texture,
    )  # fmt: skip
    return made, level


def _around(light: Map, ground: Map, ring: Mask) -> tuple[Floats, Floats]:
    """Return mean square (k,) and deviation (k,) of light from ground (k, 3, h, w) within a ring."""
    count = 3 * np.maximum(ring.sum(axis=(1, 2)), 1)
    where = ring[:, None]
    roots = np.where(where, np.sqrt(np.maximum(light, 0)) - np.sqrt(ground), 0)
    off = np.where(where, light - ground, 0)
    sums = (each.sum(axis=(1, 2, 3), dtype=np.float64) / count for each in (roots**2, off, off**2))
    texture, mean, square = sums
    return texture, np.sqrt(np.maximum(square - mean**2, 0))


def _distances(masks: Mask) -> Map:
    """Return (k, h, w) distances in pixels to the nearest pixel of a mask, exact up to `PAD`."""
    count, height, width = masks.shape
    # Stacked vertically, too far apart to affect each other.
    stack = np.ones((count, height + 2 * PAD, width), np.uint8)
    stack[:, PAD:-PAD] = ~masks
    found = cv2.distanceTransform(stack.reshape(-1, width), cv2.DIST_L2, 5)
    return np.asarray(found.reshape(stack.shape)[:, PAD:-PAD])


def _ground(light: Map, ring: Mask) -> Map:
    """Estimate the background (k, 3, h, w) from light (k, 3, h, w) in `ring` (k, h, w), near pixels first."""
    known = np.concatenate([light * ring[:, None], ring[:, None]], axis=1, dtype=np.float32)
    total = np.zeros_like(known)
    for weight, reach in ((1.0, NEAR), (1e-2, 3 * NEAR), (1e-4, 9 * NEAR)):
        down, across = (gaussian(n, reach) for n in known.shape[2:])
        total += np.float32(weight) * (down @ (known @ across.T))
    return np.asarray(np.maximum(total[:, :3] / np.maximum(total[:, 3:], 1e-20), 0), np.float32)


@lru_cache(maxsize=256)
def gaussian(size: int, spread: float) -> Map:
    """Return the (n, n) matrix that blurs n values as OpenCV does, with zeros outside."""
    taps = round(8 * spread + 1) | 1
    kernel = cv2.getGaussianKernel(taps, spread, cv2.CV_32F).ravel()
    away = np.arange(size)[:, None] - np.arange(size) + taps // 2
    return np.where((away >= 0) & (away < taps), kernel[np.clip(away, 0, taps - 1)], np.float32(0))


def _medians(values: Map, among: Mask) -> Floats:
    """Return (k, c) medians of values (k, c, h, w) in masks (k, h, w), none of which is empty."""
    ordered = np.sort(np.where(among[:, None], values, np.inf).reshape(*values.shape[:2], -1), axis=2)
    count = among.sum(axis=(1, 2))[:, None, None]
    low, high = (np.take_along_axis(ordered, (count - odd) // 2, axis=2)[..., 0] for odd in (1, 0))
    return np.asarray((low.astype(np.float64) + high) / 2)


def brightest(picture: LinearRGBA) -> Map:
    """Return the (H, W) largest of three channels of a picture (H, W, 3 or 4)."""
    # NumPy takes ten times as long over so short an axis.
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])


def point_spread(picture: LinearRGBA) -> float:
    """Measure the point spread of a picture (H, W, 3 or 4) as a Gaussian's standard deviation in pixels.

    Sharp edges are compared by their largest step between pixels, as a share of the contrast over seven.
    """
    # By luma, which optics blur as they blur light: in the largest channel, edges between two colours are
    # sharper.
    grey = picture[..., :3] @ LUMA
    near_clipped = cv2.dilate((brightest(picture) > 0.9).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    sharpness = []
    for light, off in ((grey, near_clipped), (grey.T, near_clipped.T)):
        light = np.ascontiguousarray(light)
        step = np.abs(np.diff(light, axis=1))
        along = np.ones((1, 7), np.uint8)
        contrast = (cv2.dilate(light, along) - cv2.erode(light, along))[:, :-1]
        peaks = step >= cv2.dilate(step, np.ones((1, 3), np.uint8))
        used = peaks & (contrast > EDGE_CONTRAST) & ~off[:, :-1]
        sharpness.append(step[used] / contrast[used])
    found = np.concatenate(sharpness)
    if len(found) < FEWEST_EDGES:
        return SPREAD
    # A pixel's step over the edge: the share of a Gaussian within half a pixel.
    spreads = np.linspace(*SPREADS, 113)
    steps = np.array([2 * _normal(0.5 / s) - 1 for s in spreads])
    return float(np.interp(-np.percentile(found, EDGE_SHARE), -steps, spreads))


def _falling[T: (float, Floats, Map)](value: T, low: float, high: float) -> T:
    """Fall smoothly from 1 at `low` to 0 at `high` (smoothstep)."""
    share = np.clip((value - low) / (high - low), 0, 1)
    return 1 - share * share * (3 - 2 * share)  # type: ignore[return-value, no-any-return]


def _normal(x: float) -> float:
    """Return the standard normal distribution function."""
    return (1 + erf(x / 2**0.5)) / 2
