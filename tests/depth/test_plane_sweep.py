"""The mismatch of a frame with its neighbours at every depth level."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes
from addon.core.depth import plane_sweep
from addon.core.depth.plane_sweep import FAR_PREFERENCE, GUIDE_RADIUS, TRUNCATION, View, sweep
from addon.core.depth.semiglobal import STEPS

from ..planes import texture

LEVELS = np.linspace(0, 1, 9)
PARALLAX = np.array([[0, 0, 8.0], [0, 0, 0], [0, 0, 0]])
"""A pixel to the right from each level to the next."""


def shifted(picture: Bytes, columns: int, side: int) -> View:
    """A neighbour to which a plane at the level of so many columns is seen."""
    seen = np.zeros_like(picture)
    seen[:, columns:] = picture[:, : picture.shape[1] - columns]
    return View(seen, np.eye(3), PARALLAX, side)


@pytest.fixture
def picture() -> Bytes:
    grey = texture(200, 150, seed=4)
    return np.dstack([grey, grey, grey, np.full_like(grey, 255)])


def test_a_level_that_fits_costs_nothing_but_its_preference(picture: Bytes) -> None:
    guide = picture[..., 0].astype(np.float32)
    costs = sweep(picture, [shifted(picture, 5, 1)], LEVELS, guide)
    inner = costs[10:-10, :, 20:-20]
    assert np.all(inner.argmin(axis=1) == 5)
    preference = round(STEPS * FAR_PREFERENCE * 5 / 8)
    np.testing.assert_allclose(inner[:, 5], preference, atol=1)
    # All is cut at the truncation: the largest is what a farther level costs less.
    assert inner.max() <= STEPS * (1.3 * TRUNCATION + FAR_PREFERENCE)


def test_the_better_side_counts(picture: Bytes) -> None:
    """What one side shows is hidden from the other by something else."""
    guide = picture[..., 0].astype(np.float32)
    right = View(255 - picture // 2, np.eye(3), PARALLAX, -1)
    costs = sweep(picture, [shifted(picture, 5, 1), right], LEVELS, guide)
    assert np.mean(costs[10:-10, :, 20:-20].argmin(axis=1) == 5) > 0.99


def test_a_level_that_no_neighbour_sees_costs_what_the_best_does(picture: Bytes) -> None:
    guide = picture[..., 0].astype(np.float32)
    view = shifted(picture, 5, 1)
    # Past its right border: at level k the last k columns, and what a guided filter reaches from there.
    costs = sweep(picture, [view], LEVELS, guide)
    reach, least = 2 * GUIDE_RADIUS, costs.min(axis=1)
    for level in range(9):
        past = np.s_[reach:-reach, 200 - level :]
        np.testing.assert_array_equal(costs[:, level][past], least[past])


def test_what_is_seen_of_one_channel_is_left_out(picture: Bytes) -> None:
    """What a neighbour's fourth channel takes away has no part in the mismatch."""
    guide = picture[..., 0].astype(np.float32)
    spoilt = shifted(picture, 5, 1)
    spoilt.picture[40:80, 60:100, :3] = 0
    spoilt.picture[40:80, 60:100, 3] = 85
    views = [spoilt, shifted(picture, 5, 1)]
    found, alone = (sweep(picture, some, LEVELS, guide)[:, 5] for some in (views, views[1:]))
    # A level of grey is rounded away where a mean of two is of even ones.
    np.testing.assert_allclose(found[10:-10, 20:-20], alone[10:-10, 20:-20], atol=STEPS // 50)


def test_what_is_found_does_not_depend_on_the_processors(
    picture: Bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide = cv2.GaussianBlur(picture[..., 0], (3, 3), 0).astype(np.float32)
    found = []
    for workers in (1, 2, 5, 16):
        monkeypatch.setattr(plane_sweep, "threads", lambda workers=workers: workers)
        found.append(sweep(picture, [shifted(picture, 5, 1)], LEVELS, guide))
    for each in found[1:]:
        np.testing.assert_array_equal(each, found[0])
