"""Stereo's depth completed by a map that bends: its own where it is sure, else the map's shape."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.camera.intrinsics import Intrinsics
from addon.core.depth.completed_depth import completed, stepped
from addon.core.depth.multi_view_stereo import DenseDepth

WIDTH, HEIGHT = 320, 180
X, Y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
WALL = 0.2 + 0.1 * X + 0.05 * Y
"""A slanted wall: inverse depth is linear over the picture."""
BALL = (X - 0.5) ** 2 * (WIDTH / HEIGHT) ** 2 + (Y - 0.5) ** 2 < 0.2**2
LEVEL = 0.15 / 50
"""A fiftieth of the range of inverse depths."""


def found(inverse: np.ndarray, sure: np.ndarray, moving: np.ndarray | None = None) -> DenseDepth:
    """What stereo says: the depth where it is sure, elsewhere that of nothing in particular."""
    guess = np.where(sure, inverse, 0.25).astype(np.float32)
    nothing = np.zeros(inverse.shape, bool)
    pinhole = Intrinsics(WIDTH, HEIGHT, 300.0, 300.0, WIDTH / 2, HEIGHT / 2)
    return DenseDepth(
        1, guess, sure.astype(np.float32), nothing if moving is None else moving, pinhole
    )  # fmt: skip


def bent(inverse: np.ndarray) -> np.ndarray:
    """(h, w) as a network has it after one fit for the picture: off by up to 15 % of the range, smoothly."""
    off = 0.15 * np.ptp(inverse) * (np.cos(2 * X) * np.sin(2 * Y + 1))
    return np.asarray(inverse * (1 + 0.1 * np.sin(2 * X)) + off, np.float32)


def test_a_hole_in_a_wall_has_the_walls_depth() -> None:
    """Plain paint amid texture: the map's bend is taken out by what is around."""
    sure = np.abs(X - 0.5) > 0.15
    result = completed(found(WALL, sure), bent(WALL))
    before, after = (np.abs(each - WALL)[~sure] for each in (bent(WALL), result.inverse_depth))
    assert np.median(after) < LEVEL
    assert after.max() < 0.5 * before.max()
    assert (result.confidence[~sure] > 0.1).all()


def test_scattered_matches_do_not_outweigh_the_map() -> None:
    """Plain walls and gloss: few pixels seem sure, and most that contradict the map are chance."""
    rng = np.random.default_rng(8)
    sure = rng.random(WALL.shape) < 0.2
    wrong = sure & (rng.random(WALL.shape) < 0.3)
    depth = found(np.where(wrong, rng.uniform(0.4, 0.6, WALL.shape), WALL), sure)
    result = completed(depth, bent(WALL)).inverse_depth
    before, after = (np.abs(each - WALL) for each in (depth.inverse_depth, result))
    assert np.mean(before > 0.1) > 0.05
    assert np.mean(after > 0.1) < 0.002


@pytest.mark.parametrize("moves", [False, True])
def test_a_ball_of_which_nothing_is_sure_stands_out_of_the_wall(moves: bool) -> None:
    """Glossy, or moving by itself: only the map has seen it, and its outline is soft there."""
    true = np.where(BALL, 0.5, WALL)
    soft = cv2.GaussianBlur(true, (0, 0), 1.5)
    sure = ~BALL | moves
    depth = found(WALL, sure, BALL if moves else None)
    result = completed(depth, bent(soft)).inverse_depth
    inside = cv2.erode(BALL.astype(np.uint8), np.ones((9, 9))) > 0
    assert np.abs(result - true)[inside].max() < 0.15 * 0.5
    # It ends in a step, not in a ramp.
    between = (result > WALL + 0.06) & (result < 0.5 - 0.08)
    assert between.sum() < 0.02 * BALL.sum()


def test_a_map_that_is_true_is_kept() -> None:
    """Of a renderer, or a sensor: nothing is made worse where stereo knows nothing at all."""
    true = np.where(BALL, 0.5, WALL).astype(np.float32)
    for share in (0.0, 0.01, 0.1):
        sure = np.random.default_rng(5).random(WALL.shape) < share
        result = completed(found(true, sure), true).inverse_depth
        wrong = np.abs(result - true) > LEVEL
        assert wrong.mean() < 0.002


def test_a_soft_edge_becomes_a_step_in_its_middle() -> None:
    """But for its ends, which are hardly steep."""
    true = np.where(X < 0.5, 0.5, 0.2).astype(np.float32)
    soft = cv2.GaussianBlur(true, (0, 0), 1.5)
    result = stepped(soft, LEVEL)
    assert np.abs(soft - true).max() > 0.1
    assert np.abs(result - true).max() < 0.05


def test_a_strip_between_something_near_and_something_far_keeps_its_depth() -> None:
    """A roof between a face and the sky: as wide as it is soft around, it is neither."""
    near, strip = X < 0.5, (X >= 0.5) & (X < 0.5 + 9 / WIDTH)
    true = np.select([near, strip], [0.5, 0.32], 0.2).astype(np.float32)
    soft = cv2.GaussianBlur(true, (0, 0), 1.0)
    inner = (X > 0.5 + 3 / WIDTH) & (X < 0.5 + 6 / WIDTH)
    for given in (true, soft):
        result = stepped(given, LEVEL)
        np.testing.assert_allclose(result[inner], 0.32, atol=2 * LEVEL)
        np.testing.assert_allclose(result[near], 0.5, atol=0.02)
