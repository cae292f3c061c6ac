"""What lamps are: radiances and colours that the light sources of a clip have, whatever the rim of one says.

A rim tells little of a very bright lamp, and lamps of a clip are of few kinds. So all of them together tell
what each may be (`kinds_of`), and a colour that a rim does not tell is that of a lamp (`tints`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.arrays import Floats, Map, Mask

RADIANCES: Floats = np.geomspace(1.0, 1000.0, 28)
"""Radiances of a light source that are compared, times white: a ratio of 1.29 apart."""
PRIOR = ((4.0, 0.7), (30.0, 1.2))
"""Median radiances of paper lanterns and screens and of bare lamps, times white, and the spreads of their
logarithms, where neither rims nor the other ones of the clip tell which: the former have 3 to 11, the latter
30 to over 1,000."""
PAINT = 0.25
"""Probability that a blob is no brighter than it was recorded, before its rim is looked at. Of 0.25 and 0.5
lamps of 2 times white get 0.93 to 0.99 and 0.85 to 0.88 of their energy."""
AREAS: Floats = np.geomspace(1.0, 512.0, 10)
"""Clipped pixels of light sources: kinds differ in size, too."""
LIKE_AREA, LIKE_RADIANCE = 0.7, 0.25
"""Logarithms of ratios of areas, and of radiances, within which light sources are of one kind."""
KNOWN = 1.0
"""As many light sources of the clip count as much as what is known of light sources before. Chosen by
inspection."""
ROUNDS = 20
"""Of expectation maximisation."""
TINT_AXES: Floats = np.array([[-0.42, 0.91], [0.91, 0.42]])
"""Of the logarithms of red and of blue over green, the direction in which glowing bodies of 2,700 to 10,000 K
lie, linear sRGB, and the one across."""
TINT_MEAN: Floats = np.array([-0.35, 0.0])
TINT_SPREAD: Floats = np.array([0.6, 0.45])
"""Mean and standard deviation of light sources' colours in these: warm white, of about 4,000 K. Chosen by
inspection."""
TINT_RATIO = 0.5
"""Logarithm, standard deviation of a channel's ratio to the largest, as a rim tells it. Chosen by
inspection."""
LEAST_TINT, LEAST_DOUBT = 0.02, 0.2
"""Of a rim's largest channel: what each has at least, and what it is off by at least."""
UNCLIPPED = 0.8
"""Of a blob's brightest channel, under which another one in its middle is not clipped: where all are, H.264
leaves 0.86 of one beside the others, as colours have half the resolution."""


@dataclass(frozen=True)
class Lamps:
    """What the rims of a picture's blobs tell of them, n in all: as much as other frames need to know."""

    centre: Map
    """(n, 2) x and y as shares of the picture's width and height."""
    area: Map
    """(n,) clipped pixels."""
    evidence: Map
    """(n, r) logarithm of the likelihood of each of `RADIANCES`, over the largest one."""
    tint: Map
    """(n, 3) linear colour, its largest channel being 1."""

    def __len__(self) -> int:
        return len(self.area)


def kinds_of(frames: Sequence[Lamps]) -> Floats:
    """(a, r) how likely each of `RADIANCES` is in a clip for light sources of about each of `AREAS`, before
    the rim of one is looked at, by what the rims of all in some of its frames tell.

    An empirical Bayes prior, by expectation maximisation: Robbins, "An empirical Bayes approach to
    statistics", 1956. Without any it is `PRIOR`.
    """
    base = _base()
    kinds = np.tile(base, (len(AREAS), 1))
    area, evidence = (
        np.concatenate([getattr(each, name) for each in frames]) if frames else np.zeros(0)
        for name in ("area", "evidence")
    )
    if not len(area):
        return kinds
    near, likely = by_area(area), np.exp(evidence.astype(np.float64))
    for _ in range(ROUNDS):
        own = likely * (near @ kinds)
        own /= own.sum(axis=1, keepdims=True)
        # A light source is seen in each of the frames, and counts once.
        kinds = KNOWN * base + near.T @ own @ _alike() / len(frames)
        kinds /= kinds.sum(axis=1, keepdims=True)
    return kinds


def tints(rim: Floats, doubt: Floats) -> Floats:
    """(k, 3) linear colours, largest 1, of light sources whose rims have light (k, 3), right to `doubt` (k,)
    in each channel: the less that is known, the nearer to warm white and to colours of glowing bodies."""
    most = np.maximum(rim.max(axis=1), 1e-3)[:, None]
    safe = rim / most + LEAST_TINT
    place = np.log(safe[:, [0, 2]] / safe[:, 1:2]) @ TINT_AXES.T
    unsure = doubt[:, None] / most + LEAST_DOUBT
    known = TINT_SPREAD**2 / (TINT_SPREAD**2 + unsure**2)
    red, blue = np.exp((TINT_MEAN + (place - TINT_MEAN) * known) @ TINT_AXES).T
    tint = np.stack([red, np.ones_like(red), blue], axis=1)
    return np.asarray(tint / tint.max(axis=1, keepdims=True))


def is_known(core: Floats) -> Mask:
    """(..., 3) which channels of cores (..., 3) the camera did not clip."""
    return np.asarray(core < UNCLIPPED * core.max(axis=-1, keepdims=True))


def as_tinted(tint: Floats, core: Floats) -> Floats:
    """(k, r) logarithm of how likely radiances are of light sources of tints (k, 3) whose cores were recorded
    with light (k, 3): the channels that the camera did not clip tell the others."""
    told = np.log(np.maximum(core, LEAST_TINT) / np.maximum(tint, LEAST_TINT))[..., None]
    off = (np.log(RADIANCES) - told) / TINT_RATIO
    return np.asarray((-(off**2) / 2 * is_known(core)[..., None]).sum(axis=1))


@lru_cache
def _base() -> Floats:
    """(r,) how likely a radiance is before anything of the clip is looked at."""
    light = np.zeros(len(RADIANCES))
    for median, spread in PRIOR:
        light += np.exp(-((np.log(RADIANCES / median) / spread) ** 2) / 2) / spread
    paint = np.zeros(len(RADIANCES))
    paint[0] = 1
    return np.asarray(PAINT * paint + (1 - PAINT) * light / light.sum())


def by_area(area: Floats) -> Floats:
    """(n, a) how much light sources of clipped pixels (n,) are of each of `AREAS`, sum 1."""
    away = np.log(np.maximum(area, 1)[:, None] / AREAS) / LIKE_AREA
    near = np.exp(-((away - away[np.arange(len(away)), np.abs(away).argmin(axis=1), None]) ** 2) / 2)
    return np.asarray(near / near.sum(axis=1, keepdims=True))


@lru_cache
def _alike() -> Floats:
    """(r, r) shares by which a radiance is another one of the same kind; paint is a kind of its own."""
    away = np.log(RADIANCES[:, None] / RADIANCES) / LIKE_RADIANCE
    near = np.exp(-(away**2) / 2)
    near[0, 1:] = near[1:, 0] = 0
    return np.asarray(near / near.sum(axis=1, keepdims=True))
