"""Costs summed along rows and columns, against the textbook's recursion, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Map
from addon.core.depth import plane_sweep
from addon.core.depth.plane_sweep import SweepOptions, View, semiglobal, sweep

OPTIONS = SweepOptions()


def by_hand(costs: Map, guide: Map) -> Map:
    """Hirschmueller 2008, eq. 13, in four directions."""
    levels, height, width = costs.shape
    total = np.zeros(costs.shape)
    for down, across in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path = np.zeros(costs.shape)
        for row in range(height)[:: down or 1]:
            for column in range(width)[:: across or 1]:
                before = row - down, column - across
                if not (0 <= before[0] < height and 0 <= before[1] < width):
                    path[:, row, column] = costs[:, row, column]
                    continue
                last = path[:, *before]
                jump = max(
                    OPTIONS.p2 / (1 + abs(guide[row, column] - guide[before]) / OPTIONS.p2_halved_at),
                    1.1 * OPTIONS.p1,
                )
                for k in range(levels):
                    steps = [last[j] + OPTIONS.p1 for j in (k - 1, k + 1) if 0 <= j < levels]
                    best = min(last[k], last.min() + jump, *steps)
                    path[k, row, column] = costs[k, row, column] + best - last.min()
        total += path
    return total


def test_costs_are_summed_along_four_directions() -> None:
    random = np.random.default_rng(3)
    costs = random.uniform(0, 20, (7, 9, 12)).astype(np.float32)
    guide = random.uniform(0, 60, (9, 12)).astype(np.float32)
    np.testing.assert_allclose(semiglobal(costs, guide, OPTIONS), by_hand(costs, guide), rtol=1e-5, atol=1e-4)


def test_what_is_found_does_not_depend_on_the_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(4)
    costs = random.uniform(0, 20, (7, 150, 200)).astype(np.float32)
    guide = random.uniform(0, 60, (150, 200)).astype(np.float32)
    picture = random.integers(0, 255, (150, 200, 4), np.uint8)
    view = View(picture, np.eye(3), np.array([[0, 0, 8.0], [0, 0, 0], [0, 0, 0]]), 1)
    found = []
    for workers in (1, 2, 5, 16):
        monkeypatch.setattr(plane_sweep, "threads", lambda workers=workers: workers)
        found.append(
            (semiglobal(costs, guide, OPTIONS), sweep(picture, [view], np.linspace(0, 1, 9), guide, OPTIONS))
        )
    for summed, swept in found[1:]:
        np.testing.assert_array_equal(summed, found[0][0])
        np.testing.assert_array_equal(swept, found[0][1])
