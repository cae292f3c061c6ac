"""Radiances and colours of the lamps of a clip.

A rim hardly constrains a very bright lamp, but the lamps of a clip are of few kinds. All of them together
give the prior of each (`kinds_of`), and a colour prior completes the rim's colour (`tints`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..base.arrays import Floats, Map, Mask

RADIANCES: Floats = np.geomspace(1.0, 1000.0, 28)
"""Compared radiances of a light source, times white: a ratio of 1.29 apart."""
PRIOR = ((4.0, 0.7), (30.0, 1.2))
"""Prior median radiances, times white, and spreads of logarithms: of paper lanterns and screens, which have 3
to 11, and of bare lamps, which have 30 to over 1,000."""
PAINT = 0.25
"""Prior probability that a blob is no brighter than recorded. With 0.25 and 0.5, lamps of 2 times white get
0.93 to 0.99 and 0.85 to 0.88 of their energy."""
AREAS: Floats = np.geomspace(1.0, 512.0, 10)
"""Clipped pixels of light sources, by which kinds differ, too."""
LIKE_AREA, LIKE_RADIANCE = 0.7, 0.25
"""Spreads of the logarithms of areas and of radiances within a kind."""
KNOWN = 1.0
"""Number of light sources of the clip that weigh as much as the prior. Chosen by inspection."""
ROUNDS = 20
"""Rounds of expectation maximisation."""
TINT_AXES: Floats = np.array([[-0.42, 0.91], [0.91, 0.42]])
"""Axes in logarithms of red and blue over green, linear sRGB: black bodies (2,700 to 10,000 K); across."""
TINT_MEAN: Floats = np.array([-0.35, 0.0])
TINT_SPREAD: Floats = np.array([0.6, 0.45])
"""Mean and deviation of light sources' colours on these axes: warm white, 4,000 K. Chosen by inspection."""
TINT_RATIO = 0.5
"""Standard deviation of the logarithm of a channel's ratio to the largest in a rim. Chosen by inspection."""
LEAST_TINT, LEAST_DOUBT = 0.02, 0.2
"""Least value and least error of each channel, as shares of a rim's largest."""
UNCLIPPED = 0.8
"""Share of a blob's brightest channel below which another is not clipped: if all are, H.264, with chroma at
half the resolution, leaves one at 0.86 of the others."""


@dataclass(frozen=True)
class Lamps:
    """Evidence from the rims of a picture's n blobs, for use in other frames."""

    centre: Map
    """(n, 2) x and y as shares of the picture's width and height."""
    area: Map
    """(n,) clipped pixels."""
    evidence: Map
    """(n, r) log likelihood of each of `RADIANCES`, relative to the largest one."""
    tint: Map
    """(n, 3) linear colour, of which the largest channel is 1."""

    def __len__(self) -> int:
        return len(self.area)


def kinds_of(frames: Sequence[Lamps]) -> Floats:
    """Return (a, r) prior probabilities of `RADIANCES` in a clip, for each of `AREAS`.

    An empirical Bayes prior from the rims in some frames, by expectation maximisation: Robbins, "An empirical
    Bayes approach to statistics", 1956. Without frames it is `PRIOR`.
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
        # A light source that is seen in each of the frames counts once.
        kinds = KNOWN * base + near.T @ own @ _alike() / len(frames)
        kinds /= kinds.sum(axis=1, keepdims=True)
    return kinds


def tints(rim: Floats, doubt: Floats) -> Floats:
    """Return linear colours (k, 3), largest channel 1, of light sources by the light of their rims (k, 3).

    With more `doubt` (k,), the standard deviation of a channel, they are nearer to warm white and to colours
    of glowing bodies.
    """
    most = np.maximum(rim.max(axis=1), 1e-3)[:, None]
    safe = rim / most + LEAST_TINT
    place = np.log(safe[:, [0, 2]] / safe[:, 1:2]) @ TINT_AXES.T
    unsure = doubt[:, None] / most + LEAST_DOUBT
    known = TINT_SPREAD**2 / (TINT_SPREAD**2 + unsure**2)
    red, blue = np.exp((TINT_MEAN + (place - TINT_MEAN) * known) @ TINT_AXES).T
    tint = np.stack([red, np.ones_like(red), blue], axis=1)
    return np.asarray(tint / tint.max(axis=1, keepdims=True))


def is_known(core: Floats) -> Mask:
    """Mark channels of cores (..., 3) that the camera did not clip."""
    return np.asarray(core < UNCLIPPED * core.max(axis=-1, keepdims=True))


def as_tinted(tint: Floats, core: Floats) -> Floats:
    """Return the log-likelihood (k, r) of radiances by the channels that the camera did not clip.

    `tint` (k, 3) are the colours of the light sources, `core` (k, 3) the recorded light of their cores.
    """
    told = np.log(np.maximum(core, LEAST_TINT) / np.maximum(tint, LEAST_TINT))[..., None]
    off = (np.log(RADIANCES) - told) / TINT_RATIO
    return np.asarray((-(off**2) / 2 * is_known(core)[..., None]).sum(axis=1))


@lru_cache
def _base() -> Floats:
    """Return (r,) prior probabilities of radiances."""
    light = np.zeros(len(RADIANCES))
    for median, spread in PRIOR:
        light += np.exp(-((np.log(RADIANCES / median) / spread) ** 2) / 2) / spread
    paint = np.zeros(len(RADIANCES))
    paint[0] = 1
    return np.asarray(PAINT * paint + (1 - PAINT) * light / light.sum())


def by_area(area: Floats) -> Floats:
    """Return (n, a) weights, of sum 1, of `AREAS` for light sources of (n,) clipped pixels."""
    away = np.log(np.maximum(area, 1)[:, None] / AREAS) / LIKE_AREA
    near = np.exp(-((away - away[np.arange(len(away)), np.abs(away).argmin(axis=1), None]) ** 2) / 2)
    return np.asarray(near / near.sum(axis=1, keepdims=True))


@lru_cache
def _alike() -> Floats:
    """Return (r, r) shares of radiances within a kind; paint is its own kind."""
    away = np.log(RADIANCES[:, None] / RADIANCES) / LIKE_RADIANCE
    near = np.exp(-(away**2) / 2)
    near[0, 1:] = near[1:, 0] = 0
    return np.asarray(near / near.sum(axis=1, keepdims=True))
