"""The small clipped blobs of a picture and their surroundings, to which `highlights` fits its model.

They may be light sources, glints or specular edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import erf

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, Ints, LinearRGBA, Map, Mask
from ..base.progress import checkpoint

LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Shares of channels in the luma of BT.709, which clips are coded by: colours have half of its resolution."""
NEAR = 1.5
"""Standard deviation in pixels of the weights of the surroundings that give a blob's background. Chosen by
inspection."""
PAD = 5
"""Pixels around a blob in which its surroundings are looked at."""
EDGE_CONTRAST = 0.15
"""Linear light between both sides of an edge by which the point spread may be measured."""
EDGE_SHARE = 85.0
"""Percentile of edges, by sharpness, that counts as sharp: 0.42 px on bars, whose true filter has 0.42."""
FEWEST_EDGES = 100
SPREAD = 0.42
"""Pixels, standard deviation: the point spread of a picture of fewer edges, that of a sharp one. A
larger one than is true makes lamps too bright."""
SPREADS = (0.38, 1.5)
"""Least and largest one that is believed."""
THICKNESS = (0.02, 0.04)
"""Shares of the long side: a blob's thickness up to the first is a light source's, from the second a sky,
wall or window. Chosen by inspection."""
LENGTH = (0.1, 0.2)
"""Shares of the long side for a blob's length, like `THICKNESS`. Chosen by inspection."""
AMONG = (0.0, 0.25)
"""Share of large clipped areas in the surroundings, from none to so much that a blob is a piece of them: sky
between leaves. Chosen by inspection."""
AROUND = 0.02
"""Share of the long side up to which these surroundings reach. Chosen by inspection."""
GROUND = (0.4, 0.8)
"""Linear light of the surroundings: with the first a blob may be a light source, with the second it is noise
on something white. Chosen by inspection."""
FLAT = (0.012, 0.022)
"""Linear light over the threshold, mean of a blob's pixels: from the second on they are clipped but for
noise, up to the first they are paint that is nearly white, as in walk and fence (else 0.7, 0.3 dB less)."""
NEARLY = 0.92
"""Share of the threshold from which a pixel belongs to a blob: coded clips have clipped pixels below white,
247 to 254 of 255 in H.264 at a rate factor of 20."""
LOW, WHITES = 10.0, (0.85, 1.0)
"""Percentile of the recorded values within blobs above which all are clipped, and its bounds."""
MOST = 4096
"""Blobs of a picture, those of most pixels, that are looked at: three times those of a night street at
1280x720, and as many discs as touch each other when each is 15 pixels wide."""
USED = 3
"""Pixels around a blob that are used."""
ALIKE = 2
"""Pixels: sides of patches are multiples of it, so that many are looked at together."""


@dataclass(frozen=True)
class Blobs:
    """The small clipped blobs of a picture, n in all, that may be light sources."""

    centre: Floats
    """(n, 2) x and y as shares of the picture's width and height."""
    area: Floats
    """(n,) clipped pixels."""
    weight: Floats
    """(n,) 0 to 1, how sure it is a light source and not a piece of a large clipped area."""
    spread: float
    """Standard deviation of the picture's point spread in pixels."""
    white: float
    """Linear light over which a pixel is clipped: less in coded clips, whose clipped pixels differ."""
    patches: tuple[Patches, ...]
    """Their surroundings, those of one size together."""

    def __len__(self) -> int:
        return len(self.area)


@dataclass(frozen=True)
class Patches:
    """The surroundings of k blobs of a picture, of one size (h, w): `USED` pixels or more around each.

    Past the picture's border they go on as at it.
    """

    number: Indices
    """(k,) which of the picture's blobs it is."""
    pixel: Indices
    """(k, h, w) of the picture, counted along its rows."""
    light: Map
    """(k, 3, h, w) linear."""
    ground: Map
    """(k, 3, h, w) linear colour behind it, as what is around lets expect."""
    own: Mask
    """(k, h, w) the blob's pixels, also past the border."""
    seen: Mask
    """(k, h, w) those in the picture."""
    beside: Mask
    """(k, h, w) its rim."""
    used: Mask
    """(k, h, w) used pixels: the blob's, and those around it that no other blob reaches."""
    core: Floats
    """(k, 3) linear colour that its clipped pixels were recorded with, the median."""
    rim: Floats
    """(k, 3) linear light of its rim: the sum over the ground."""
    doubt: Floats
    """(k,) standard deviation of the rim in a channel, from the texture of the ground."""
    texture: Floats
    """(k,) mean square of the surroundings' difference from the ground, of square roots of linear light."""

    def __len__(self) -> int:
        return len(self.number)

    def among(self, which: Mask | Indices | slice) -> Patches:
        """Some of them."""
        return Patches(*(value[which] for value in vars(self).values()))


def clipped_blobs(picture: LinearRGBA, threshold: float) -> Blobs:
    """Find the small clipped blobs of a picture (H, W, 3 or 4), linear.

    They are connected pixels with nearly `threshold` of white in a channel, at least one with all of it, at
    most `MOST`. Those without weight are left out. Passes checkpoints.
    """
    peak = brightest(picture)
    clipped = peak >= NEARLY * threshold
    if not (peak >= threshold).any():
        return Blobs(np.zeros((0, 2)), np.zeros(0), np.zeros(0), SPREAD, 1.0, ())
    _, label, stats, centres = cv2.connectedComponentsWithStats(clipped.astype(np.uint8), connectivity=8)
    weight = _weights(peak, clipped, label, stats, centres, threshold)
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
        sure[some] = weight[some] * _falling(ground, *GROUND)
        found.append(made.among(sure[some] > 0))
    kept = np.flatnonzero(sure > 0)
    renamed = np.zeros(len(weight), np.intp)
    renamed[kept] = np.arange(len(kept))
    patches = tuple(replace(each, number=renamed[each.number]) for each in found if len(each))
    centre = (centres[kept] + 0.5) / peak.shape[::-1]
    within = (cv2.erode(clipped.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & (sure > 0)[label]
    white = float(np.clip(np.percentile(peak[within], LOW), *WHITES)) if within.any() else 1.0
    area = stats[kept, cv2.CC_STAT_AREA].astype(np.float64)
    return Blobs(centre, area, sure[kept], spread, white, patches)


def _weights(peak: Map, clipped: Mask, label: Ints, stats: Ints, centres: Floats, threshold: float) -> Floats:
    """(n,) probabilities of components to be light sources, before their ground is known.

    Components are OpenCV's statistics in a picture's largest channel (H, W).
    """
    long_side = max(peak.shape)
    row, column = np.nonzero(clipped)
    of, count = label[row, column], len(stats)
    inner = cv2.distanceTransform(np.pad(clipped.astype(np.uint8), 1), cv2.DIST_L2, 5)
    thickness = np.zeros(count, np.float32)
    np.maximum.at(thickness, of, 2 * inner[row + 1, column + 1])
    value = np.minimum(peak[row, column], 1)
    most = value >= threshold
    full = np.bincount(of, most, count)
    level = np.bincount(of, np.where(most, value, 0), count) / np.maximum(full, 1)
    is_large = thickness > THICKNESS[1] * long_side
    among = np.zeros(count, np.float32)
    if is_large.any():
        reach = 2 * round(AROUND * long_side) + 1
        around = cv2.boxFilter(is_large[label].astype(np.float32), -1, (reach, reach))
        among = around[tuple(np.clip(centres.astype(int), 0, None).T[::-1])]
    flat = (min(threshold + each, 1 - 1e-3 / (1 + n)) for n, each in enumerate(FLAT))
    weight = (
        _falling(thickness / long_side, *THICKNESS)
        * _falling(stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1) / long_side, *LENGTH)
        * _falling(among, *AMONG)
        * (1 - _falling(level, *flat))
        * (full > 0)
    )
    weight[0] = 0
    return np.asarray(weight, np.float64)


def _patches(
    picture: LinearRGBA, label: Ints, stats: Ints, numbers: Indices, size: tuple[int, int]
) -> tuple[Patches, Floats]:
    """Surroundings (h, w) of components (k,) with labels (H, W), and the brightness (k,) of their ground.

    Brightness is infinite without surroundings.
    """
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
    # Among others, whatever is not one of them.
    ring |= (away > 1.5) & (labels == 0) & valid & ~ring.any(axis=(1, 2), keepdims=True)
    ground = _ground(light, ring)
    level = _medians(ground.max(axis=1)[:, None], own & valid)[:, 0]
    level[~ring.any(axis=(1, 2))] = np.inf
    texture, spread = _around(light, ground, ring)
    apart = (clear > 1.5) & valid
    beside = (away > 0) & (away <= 1.5) & apart
    rim = np.where(beside[:, None], light - ground, 0).sum(axis=(2, 3), dtype=np.float64)
    # The nearest of the ground is one patch of its texture: all of the rim may be off alike.
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
    """Difference of light (k, 3, h, w) from the ground (k, 3, h, w) in `ring` (k, h, w).

    The mean square (k,) of square roots, and the standard deviation (k,).
    """
    count = 3 * np.maximum(ring.sum(axis=(1, 2)), 1)
    where = ring[:, None]
    roots = np.where(where, np.sqrt(np.maximum(light, 0)) - np.sqrt(ground), 0)
    off = np.where(where, light - ground, 0)
    sums = (each.sum(axis=(1, 2, 3), dtype=np.float64) / count for each in (roots**2, off, off**2))
    texture, mean, square = sums
    return texture, np.sqrt(np.maximum(square - mean**2, 0))


def _distances(masks: Mask) -> Map:
    """(k, h, w) pixels to the nearest of a mask (k, h, w), right up to `PAD`; more where there is none."""
    count, height, width = masks.shape
    # Below each other, so far apart that none sees the next.
    stack = np.ones((count, height + 2 * PAD, width), np.uint8)
    stack[:, PAD:-PAD] = ~masks
    found = cv2.distanceTransform(stack.reshape(-1, width), cv2.DIST_L2, 5)
    return np.asarray(found.reshape(stack.shape)[:, PAD:-PAD])


def _ground(light: Map, ring: Mask) -> Map:
    """(k, 3, h, w) background of blobs from the light (k, 3, h, w) of the pixels around (k, h, w)."""
    known = np.concatenate([light * ring[:, None], ring[:, None]], axis=1, dtype=np.float32)
    total = np.zeros_like(known)
    for weight, reach in ((1.0, NEAR), (1e-2, 3 * NEAR), (1e-4, 9 * NEAR)):
        down, across = (gaussian(n, reach) for n in known.shape[2:])
        total += np.float32(weight) * (down @ (known @ across.T))
    return np.asarray(np.maximum(total[:, :3] / np.maximum(total[:, 3:], 1e-20), 0), np.float32)


@lru_cache(maxsize=256)
def gaussian(size: int, spread: float) -> Map:
    """(n, n) matrix that blurs n values in a row as OpenCV does, beyond which there is nothing."""
    taps = round(8 * spread + 1) | 1
    kernel = cv2.getGaussianKernel(taps, spread, cv2.CV_32F).ravel()
    away = np.arange(size)[:, None] - np.arange(size) + taps // 2
    return np.where((away >= 0) & (away < taps), kernel[np.clip(away, 0, taps - 1)], np.float32(0))


def _medians(values: Map, among: Mask) -> Floats:
    """(k, c) medians of values (k, c, h, w) in a mask (k, h, w), of which each has some."""
    ordered = np.sort(np.where(among[:, None], values, np.inf).reshape(*values.shape[:2], -1), axis=2)
    count = among.sum(axis=(1, 2))[:, None, None]
    low, high = (np.take_along_axis(ordered, (count - odd) // 2, axis=2)[..., 0] for odd in (1, 0))
    return np.asarray((low.astype(np.float64) + high) / 2)


def brightest(picture: LinearRGBA) -> Map:
    """(H, W) the largest of three channels of a picture (H, W, 3 or 4)."""
    # NumPy takes ten times as long over so short an axis.
    return np.maximum(np.maximum(picture[..., 0], picture[..., 1]), picture[..., 2])


def point_spread(picture: LinearRGBA) -> float:
    """Estimate the standard deviation in pixels of a Gaussian point spread.

    It follows from the picture's (H, W, 3 or 4) sharpest edges: the largest step between neighbours over the
    contrast across seven.
    """
    # Sums of channels, which optics blur as they do light: in the largest channel, edges between two
    # colours are sharper than any.
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
    """1 up to `low`, 0 from `high` on, without a kink (smoothstep)."""
    share = np.clip((value - low) / (high - low), 0, 1)
    return 1 - share * share * (3 - 2 * share)  # type: ignore[return-value, no-any-return]


def _normal(x: float) -> float:
    """Share of a normal distribution under x standard deviations."""
    return (1 + erf(x / 2**0.5)) / 2
