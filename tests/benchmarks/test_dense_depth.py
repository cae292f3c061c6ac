"""What dense depth is scored by."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy.dense_depth import DEEPER, SPECKLE, speckles

NEAR, FAR = 0.8, 0.2


def depth() -> np.ndarray:
    """(100, 200) inverse depth: a near half beside a far one, both a little rough."""
    made = np.full((100, 200), NEAR)
    made[:, 100:] = FAR
    return made + np.random.default_rng(0).uniform(-0.01, 0.01, made.shape)


def test_speckles_are_counted_once_each() -> None:
    made = depth()
    assert speckles(made) == 0
    made[20, 30] = made[50, 40:43] = FAR
    made[70:72, 20:23] = FAR
    assert speckles(made) == pytest.approx(3 * 1e5 / made.size)


@pytest.mark.parametrize("hole", ["large", "shallow", "nearer", "on the far side"])
def test_what_is_no_speckle_is_not_counted(hole: str) -> None:
    made = depth()
    if hole == "large":
        made[40:46, 40:46] = FAR
    elif hole == "shallow":
        made[40, 40] -= 0.8 * DEEPER * (NEAR - FAR)
    elif hole == "nearer":
        made[40, 40] = 2 * NEAR
    else:
        made[40 : 40 + SPECKLE, 150] = NEAR
    assert speckles(made) == 0


def test_the_scale_of_the_world_means_nothing() -> None:
    made = depth()
    made[10, 10] = FAR
    assert speckles(7.5 * made) == speckles(made) > 0
