"""Positions of the virtual cameras on the virtual aperture, and how many are needed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..base.errors import UserError
from ..camera.reconstruction import Floats

MIN_VIEWS, MAX_VIEWS = 16, 512
"""Bounds of the automatic number of views: fewer show as copies of lamps, more are not told apart. By eye."""
MOST_VIEWS = 1 << 16
"""Views that can be asked for: more would only fill the memory with positions."""

MOST_RELAXED = 128
"""Positions up to which they are relaxed, in at most a second; from there on Vogel's are within a decibel, by
`python -m benchmarks.timings.view_error`."""
RELAXATIONS = 60
"""Of Lloyd's iteration: after that 16 positions are still, and 64 gain less than 0.1 dB more, by the same."""
SAMPLES = 8192
"""Of the disc, by which a share's middle is told: at least 64 a share."""


def random_disc(count: int, seed: int) -> Floats:
    """(count, 2) independent, uniformly random positions on the unit disc: the thesis's section 3.5."""
    _check(count)
    rng = np.random.default_rng(seed)
    radius = np.sqrt(rng.random(count))
    angle = 2 * np.pi * rng.random(count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def vogel_disc(count: int) -> Floats:
    """(count, 2) Vogel spiral on the unit disc, recentred to a mean of exactly zero.

    Vogel, "A better way to construct the sunflower head", 1979. At equal error it needs 4 to 8 times
    fewer positions than random ones; the same positions on every frame, so that nothing flickers.
    """
    _check(count)
    index = np.arange(count)
    radius = np.sqrt((index + 0.5) / count)
    angle = index * np.pi * (3 - np.sqrt(5))
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return np.asarray(disc - disc.mean(axis=0))


@lru_cache
def centroidal_disc(count: int) -> Floats:
    """(count, 2) centroidal Voronoi positions on the unit disc, with a mean of exactly zero: each is in the
    middle of its share of the disc. Read-only.

    Du, Faber and Gunzburger, "Centroidal Voronoi tessellations", 1999, by Lloyd's iteration from Vogel's
    spiral. The spread of the positions and that within the shares make the disc's, so that blurring by a
    share's size gives the disc's own blur. More than `MOST_RELAXED` positions are Vogel's.
    """
    disc = vogel_disc(count)
    if count <= MOST_RELAXED:
        samples = vogel_disc(SAMPLES)
        for _ in range(RELAXATIONS):
            # |s - p|^2 without the samples' own part, which is the same for all positions.
            nearest = ((disc**2).sum(axis=1) - 2 * samples @ disc.T).argmin(axis=1)
            held = np.bincount(nearest, minlength=count)
            sums = [np.bincount(nearest, axis, minlength=count) for axis in samples.T]
            disc = np.where(held[:, None] > 0, np.stack(sums, axis=1) / np.maximum(held, 1)[:, None], disc)
        disc -= disc.mean(axis=0)
    disc.flags.writeable = False
    return disc


def views_needed(blur: float) -> int:
    """Number of Vogel positions for a step edge at about 45 dB under a blur disc of `blur` pixels.

    Fitted to measured 45, 80 and 130 positions at 16, 32 and 64 pixels.
    """
    if not np.isfinite(blur):
        raise UserError("the blur disc has no finite size; choose a smaller aperture")
    return int(np.clip(np.ceil(45 * (max(blur, 0.0) / 16) ** 0.77), MIN_VIEWS, MAX_VIEWS))


def _check(count: int) -> None:
    if count < 1:
        raise UserError(f"the number of views is {count}; it must be at least 1")
    if count > MOST_VIEWS:
        raise UserError(f"the number of views is {count}; it must be at most {MOST_VIEWS}")
