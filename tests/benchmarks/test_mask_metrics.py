"""The scores of subjects' masks, each on a case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import mask_metrics
from benchmarks.accuracy.mask_metrics import stroke
from benchmarks.accuracy.subjects import OTHER_DEPTH, DepthScore, other_depth

STILL = np.zeros((60, 80, 2))


def disc(x: float = 40.0, radius: float = 15.0, y: float = 30.0) -> np.ndarray:
    row, column = np.mgrid[0:60, 0:80] + 0.5
    return (column - x) ** 2 + (row - y) ** 2 <= radius**2


def block(left: int, wide: int = 20) -> np.ndarray:
    mask = np.zeros((60, 80), bool)
    mask[20:40, left : left + wide] = True
    return mask


NOTHING = np.zeros((60, 80), bool)


def test_iou_of_a_block_that_is_shifted() -> None:
    # 15 of 20 columns are shared, 25 are of either.
    assert mask_metrics.iou(block(10), block(15)) == pytest.approx(15 / 25)
    assert mask_metrics.iou(block(10), block(10)) == 1
    assert mask_metrics.iou(block(10), block(50)) == 0


def test_a_subject_that_is_hidden_is_right_if_nothing_is_found() -> None:
    for score in (mask_metrics.iou, mask_metrics.boundary_f):
        assert score(NOTHING, NOTHING) == 1
        assert score(disc(), NOTHING) == 0
        assert score(NOTHING, disc()) == 0


def test_boundary_f_forgives_two_pixels() -> None:
    assert mask_metrics.boundary_f(disc(), disc()) == 1
    assert mask_metrics.boundary_f(disc(40), disc(42)) == 1
    assert mask_metrics.boundary_f(disc(radius=12), disc(radius=20)) == 0
    # Of a block that is 10 wider to its right, 40 + 20 pixels' outline is met and 10 + 10 + 20 is not.
    wide = mask_metrics.boundary_f(block(10, 30), block(10, 20))
    assert 0.6 < wide < 0.9


def test_an_outline_that_jumps_boils_by_as_much() -> None:
    truths = [disc()] * 3
    masks = [disc(), disc(radius=18), disc()]
    assert mask_metrics.boiling(masks, truths, [STILL] * 2) == pytest.approx(3, abs=0.3)
    # A mask that is lost for a frame counts the most that counts.
    assert mask_metrics.boiling([disc(), NOTHING, disc()], truths, [STILL] * 2) == mask_metrics.FARTHEST


def test_true_motion_is_no_boiling() -> None:
    right = STILL + np.array([3.0, 0.0])
    truths = [disc(30), disc(33), disc(36)]
    masks = [disc(x, 17) for x in (30, 33, 36)]
    assert mask_metrics.boiling(masks, truths, [right] * 2) == 0
    # One that stays behind while the subject moves is 3 pixels worse in each frame at its left and right.
    late = [disc(30)] * 3
    assert mask_metrics.boiling(late, truths, [right] * 2) == pytest.approx(3 * 2 / np.pi, abs=0.4)


def test_the_band_is_on_both_sides_of_the_outline() -> None:
    row, column = np.mgrid[0:60, 0:80] + 0.5
    band = mask_metrics.outline_band(disc(), 6)
    away = np.abs(np.hypot(column - 40, row - 30) - 15)
    assert band[away < 4.5].all()
    assert not band[away > 7.5].any()
    assert not mask_metrics.outline_band(NOTHING).any()


# Depth


def depths(found_at: float, part: np.ndarray) -> DepthScore:
    """A wall that recedes from 5 to 10 m and a disc at 4 m before it, `part` of which is found elsewhere.

    What is found has another unit.
    """
    true = np.tile(np.linspace(5, 10, 80), (60, 1))
    true[disc()] = 4.0
    found = true.copy()
    found[part & disc()] = found_at
    return other_depth(7 / found, true, disc(), disc())


def test_a_part_that_lies_on_the_wall_is_torn() -> None:
    lower = np.zeros((60, 80), bool)
    lower[38:] = True
    torn, share, nearer = depths(7.0, lower)
    inner = disc() & ~mask_metrics.outline_band(disc(), 2)
    assert torn
    assert share == pytest.approx((inner & lower).sum() / inner.sum())
    assert nearer == pytest.approx(0, abs=1e-6)
    assert depths(4.0, lower) == pytest.approx((False, 0, 0))


def test_relief_and_single_pixels_are_not_torn() -> None:
    everything = np.ones((60, 80), bool)
    for times, torn in ((0.9, False), (1.1, True)):
        nearer = times * OTHER_DEPTH
        assert depths(4.0 / (1 + nearer), everything) == pytest.approx((torn, float(torn), nearer))
    dots = np.zeros((60, 80), bool)
    dots[30, 30:50:4] = True
    torn, share, _ = depths(7.0, dots)
    assert not torn
    assert share > 0
    assert other_depth(np.ones((60, 80)), np.ones((60, 80)), NOTHING, NOTHING) == (False, 0, 0)


def test_a_stroke_is_within_the_subject() -> None:
    mask = disc(30) | disc(60, 8)
    places = stroke(mask, 5)
    assert places.shape == (5, 2)
    assert (np.diff(places[:, 1]) > 0).all()
    column, row = np.floor(places * (80, 60)).astype(int).T
    assert mask[row, column].all()
    assert np.abs(column - 30).max() <= 2
    assert stroke(NOTHING, 5).shape == (0, 2)
