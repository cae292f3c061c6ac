"""The level of inverse depth that each pixel is at, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Indices, Map
from ..base.progress import checkpoint
from .plane_sweep import TRUNCATION, View, sweep
from .semiglobal import STEPS, Costs, best_levels, semiglobal

PRIOR_COST = 3.0
"""Grey levels by which levels far from a feature's own depth cost more."""
PRIOR_REACH = 4.0
"""Levels from a feature's own from which on all others cost the same."""
RIVAL_MARGIN = 3.0
"""Summed cost in grey levels: a level within so much of the best one is its rival."""
RIVAL_SHARE = 0.2
"""Share of levels that are rivals with which the best one means nothing."""
TEXTURE_WINDOW = 9
"""Pixels across the window in which the best level must beat the mean one."""
LEAST_TEXTURE = 0.4
"""Grey levels by which the best level must beat the mean in the window."""
NO_MATCH = 0.875
"""Share of the truncated mismatch from which there is no match."""


@dataclass(frozen=True)
class Winners:
    """The level of each pixel with the least sum of costs, and the measures for its confidence."""

    level: Map
    """(h, w) float32 number of the level, with its fraction."""
    rivals: Indices
    """(h, w) how many levels have sums within `RIVAL_MARGIN` of the least one, itself among them."""
    cost: Map
    """(h, w) float32 cost of the level before it is summed, in grey levels."""
    spread: Map
    """(h, w) float32 mean cost of all levels less the least one, in grey levels."""


Matcher = Callable[[Bytes, Sequence[View], Floats, Map, Map], Winners]
"""`winning_levels`, or a function with the same result within half a level, such as the GPU's."""


def matched_levels(
    picture: Bytes, views: Sequence[View], levels: Floats, known: Map, matcher: Matcher
) -> tuple[Map, Map]:
    """Return the depth level (h, w) of each pixel and its confidence (h, w), without regard to parallax.

    Args:
        picture: (h, w, 4) the frame.
        views: Its neighbours.
        levels: (k,) inverse depths, evenly spaced.
        known: (h, w) their `known_levels`, NaN where none is known.
        matcher: Finds the levels.
    """
    guide = np.asarray(cv2.cvtColor(picture[..., :3], cv2.COLOR_RGB2GRAY), np.float32)
    found = matcher(picture, views, levels, guide, known)
    texture = cv2.blur(found.spread, (TEXTURE_WINDOW,) * 2)
    unique = np.clip(1.2 - found.rivals / np.float32(RIVAL_SHARE * len(levels)), 0, 1)
    agreed = np.clip(2 - 2 * found.cost / (NO_MATCH * TRUNCATION), 0, 1)
    textured = np.clip(texture / LEAST_TEXTURE - 0.5, 0, 1)
    return found.level, np.where(picture[..., 3] < 255, 0, unique * agreed * textured).astype(np.float32)


def winning_levels(picture: Bytes, views: Sequence[View], levels: Floats, guide: Map, known: Map) -> Winners:
    """Find the depth level of each pixel of a frame (h, w, 4) by its neighbours on the processor.

    `levels` (k,) are inverse depths, `guide` (h, w) is the frame in grey levels, and `known` (h, w) the level
    of pixels with features, NaN elsewhere.
    """
    costs = sweep(picture, views, levels, guide)
    # Pixels outside of the lens's picture continue those within.
    costs.swapaxes(1, 2)[picture[..., 3] < 255] = 0
    checkpoint(0.5)
    spread = costs.mean(axis=1, dtype=np.float32) - costs.min(axis=1)
    checkpoint(0.5)
    _add_sparse_prior(costs, known)
    sums = semiglobal(costs, guide)
    checkpoint(0.7)
    best, level = best_levels(sums)
    checkpoint(0.7)
    limit = sums.min(axis=1) + np.uint16(round(STEPS * RIVAL_MARGIN))
    rivals = np.count_nonzero(sums < limit[:, None], axis=1)
    at = np.asarray(np.take_along_axis(costs, best[:, None], axis=1)[:, 0], np.float32)
    return Winners(level, rivals, at / np.float32(STEPS), spread / np.float32(STEPS))


def known_levels(inverse: Map, count: Map, levels: Floats) -> Map:
    """Return the level (h, w) of pixels with features and of those beside them, NaN elsewhere.

    `inverse` (h, w) is the mean inverse depth of a pixel's features, `count` (h, w) their number, and
    `levels` (k,) are inverse depths.
    """
    row, column = np.nonzero(cv2.dilate(count, np.ones((3, 3))))
    total, number = (cv2.boxFilter(part, -1, (3, 3), normalize=False) for part in (inverse * count, count))
    known = np.full(count.shape, np.nan, np.float32)
    mean = (total / np.maximum(number, 1))[row, column]
    known[row, column] = (mean - levels[0]) / (levels[1] - levels[0])
    return known


def _add_sparse_prior(costs: Costs, known: Map) -> None:
    """Prefer in costs (h, k, w) the levels `known` (h, w) of some pixels."""
    row, column = np.nonzero(~np.isnan(known))
    off = np.abs(np.arange(costs.shape[1], dtype=np.float32) - known[row, column][:, None])
    prior = STEPS * PRIOR_COST * np.minimum(off / PRIOR_REACH, 1)
    costs[row, :, column] += np.rint(prior).astype(np.uint16)
