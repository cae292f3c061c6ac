"""The level of inverse depth that each pixel is at, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map
from ..base.progress import checkpoint
from .plane_sweep import SweepOptions, View, sweep
from .semiglobal import STEPS, Costs, SemiglobalOptions, best_levels, semiglobal


@dataclass(frozen=True)
class MatchingOptions:
    """How a level is chosen and trusted. Set by eye, then judged together on the scenes with true depth by
    `python -m benchmarks.accuracy.dense_depth`."""

    prior_cost: float = 3.0
    """Grey levels by which levels far from a feature's own depth cost more. By eye."""
    prior_reach: float = 4.0
    """Levels from a feature's own from which on all others cost the same. By eye."""
    rival_margin: float = 3.0
    """Summed cost in grey levels: a level within so much of the best one is its rival. By eye."""
    rival_share: float = 0.2
    """Share of levels that are rivals with which the best one means nothing. By eye."""
    texture_window: int = 9
    """Pixels across the window in which the best level must beat the mean one. By eye."""
    least_texture: float = 0.4
    """Grey levels by which the best level must beat the mean there to tell anything. By eye."""
    no_match: float = 0.875
    """Of the truncated mismatch, at which nothing was found at all. By eye."""
    sweep: SweepOptions = field(default_factory=SweepOptions)
    """Matching cost."""
    semiglobal: SemiglobalOptions = field(default_factory=SemiglobalOptions)
    """Cost of a change of depth."""


@dataclass(frozen=True)
class Features:
    """What is known of some pixels beforehand."""

    inverse_depth: Map
    """(h, w) in 1 / scene units."""
    count: Map
    """(h, w) how many features tell it, 0 where it is not known."""

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> Features:
        """No pixel (h, w) is known."""
        return cls(np.zeros(shape[:2], np.float32), np.zeros(shape[:2], np.float32))


def matched_levels(
    picture: Bytes, views: Sequence[View], levels: Floats, features: Features, options: MatchingOptions
) -> tuple[Map, Map]:
    """(h, w) level, with its fraction, of a frame (h, w, 4) at inverse depths `levels` (k,), which are evenly
    apart; and the confidence (h, w) in it, before what the parallax says of it."""
    guide = np.asarray(cv2.cvtColor(picture[..., :3], cv2.COLOR_RGB2GRAY), np.float32)
    costs = sweep(picture, views, levels, guide, options.sweep)
    unseen = picture[..., 3] < 255
    # What lies past the lens's picture continues what lies within.
    costs.swapaxes(1, 2)[unseen] = 0
    checkpoint(0.5)
    spread = costs.mean(axis=1, dtype=np.float32) - costs.min(axis=1)
    texture = cv2.blur(spread / STEPS, (options.texture_window,) * 2)
    checkpoint(0.5)
    _add_sparse_prior(costs, features, levels, options)
    sums = semiglobal(costs, guide, options.semiglobal)
    checkpoint(0.7)
    best, level = best_levels(sums)
    checkpoint(0.7)
    limit = sums.min(axis=1) + np.uint16(round(STEPS * options.rival_margin))
    rivals = np.count_nonzero(sums < limit[:, None], axis=1)
    unique = np.clip(1.2 - rivals / np.float32(options.rival_share * len(levels)), 0, 1)
    at = np.take_along_axis(costs, best[:, None], axis=1)[:, 0] / np.float32(STEPS)
    agreed = np.clip(2 - 2 * at / (options.no_match * options.sweep.truncation), 0, 1)
    textured = np.clip(texture / options.least_texture - 0.5, 0, 1)
    return level, np.where(unseen, 0, unique * agreed * textured).astype(np.float32)


def _add_sparse_prior(costs: Costs, features: Features, levels: Floats, options: MatchingOptions) -> None:
    """Prefer in costs (h, k, w), at inverse depths `levels` (k,), those known of features, and in the pixels
    beside."""
    row, column = np.nonzero(cv2.dilate(features.count, np.ones((3, 3))))
    total, number = (
        cv2.boxFilter(part, -1, (3, 3), normalize=False)
        for part in (features.inverse_depth * features.count, features.count)
    )
    known = ((total / np.maximum(number, 1))[row, column] - levels[0]) / (levels[1] - levels[0])
    off = np.abs(np.arange(len(levels), dtype=np.float32) - known.astype(np.float32)[:, None])
    prior = STEPS * options.prior_cost * np.minimum(off / options.prior_reach, 1)
    costs[row, :, column] += np.rint(prior).astype(np.uint16)
