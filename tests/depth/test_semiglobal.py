"""Costs summed along rows and columns, against the textbook's recursion, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Map
from addon.core.depth import semiglobal as module
from addon.core.depth.semiglobal import P1, P2, P2_HALVED_AT, STEPS, Costs, best_levels, semiglobal


def random_costs(shape: tuple[int, int, int], seed: int) -> Costs:
    """(h, k, w) as large as the mismatch and the prior of a feature together."""
    return np.random.default_rng(seed).integers(0, 11 * STEPS, shape, np.uint16)


def by_hand(costs: Costs, guide: Map) -> Costs:
    """Hirschmueller 2008, eq. 13, in four directions, with penalties in whole steps."""
    height, levels, width = costs.shape
    total = np.zeros(costs.shape, np.int64)
    change = round(STEPS * P1)
    for down, across in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path = np.zeros(costs.shape, np.int64)
        for row in range(height)[:: down or 1]:
            for column in range(width)[:: across or 1]:
                before = row - down, column - across
                if not (0 <= before[0] < height and 0 <= before[1] < width):
                    path[row, :, column] = costs[row, :, column]
                    continue
                last = path[before[0], :, before[1]]
                edge = abs(guide[row, column] - guide[before])
                jump = round(STEPS * max(P2 / (1 + edge / P2_HALVED_AT), 1.1 * P1))
                for k in range(levels):
                    steps = [last[j] + change for j in (k - 1, k + 1) if 0 <= j < levels]
                    best = min(last[k], last.min() + jump, *steps)
                    path[row, k, column] = costs[row, k, column] + best - last.min()
        total += path
    return total


def test_costs_are_summed_along_four_directions() -> None:
    costs = random_costs((9, 7, 12), 3)
    guide = np.random.default_rng(3).uniform(0, 60, (9, 12)).astype(np.float32)
    # Penalties are rounded in single precision there and in double here: by a step a pixel of the way.
    np.testing.assert_allclose(semiglobal(costs, guide).astype(int), by_hand(costs, guide), atol=4)


def test_a_minimum_between_two_levels_is_found() -> None:
    """Of two lines of the same slope."""
    levels, true = np.arange(9), np.linspace(2, 6, 21)
    costs = (STEPS * np.abs(levels[:, None] - true)).astype(np.uint16)[None]
    _, level = best_levels(costs)
    np.testing.assert_allclose(level[0], true, atol=2 / STEPS)


def test_what_is_found_does_not_depend_on_the_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = random_costs((150, 7, 200), 4)
    guide = np.random.default_rng(4).uniform(0, 60, (150, 200)).astype(np.float32)
    found = []
    for workers in (1, 2, 5, 16):
        monkeypatch.setattr(module, "threads", lambda workers=workers: workers)
        found.append(semiglobal(costs, guide))
    for each in found[1:]:
        np.testing.assert_array_equal(each, found[0])
