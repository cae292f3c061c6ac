"""What all lamps of a clip tell of each: kinds by radiance, and colours that lamps have."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.warp.highlight_kinds import RADIANCES, Lamps, by_area, kinds_of, tints


def seen(radiance: Floats, area: float, unsure: float = 1.5) -> Lamps:
    """Lamps (n,) of whose radiance each rim says little."""
    away = np.log(RADIANCES / radiance[:, None]) / unsure
    count = len(radiance)
    evidence = (-(away**2) / 2).astype(np.float32)
    return Lamps(np.zeros((count, 2), np.float32), np.full(count, area, np.float32), evidence,
                 np.ones((count, 3), np.float32))  # fmt: skip


def likeliest(kinds: Floats, area: float) -> float:
    """Radiance of a lamp of clipped pixels, without its rim, if it is none of mere paint."""
    return float(RADIANCES[1 + (by_area(np.array([area])) @ kinds)[0, 1:].argmax()])


@pytest.mark.parametrize("radiance", [6.0, 60.0, 300.0])
def test_many_lamps_tell_what_one_does_not(radiance: float) -> None:
    kinds = kinds_of([seen(radiance * np.geomspace(0.5, 2, 30), 12.0)])
    assert likeliest(kinds, 12.0) == pytest.approx(radiance, rel=0.3)
    # More frames of the same lamps are not more lamps.
    np.testing.assert_allclose(kinds_of([seen(radiance * np.geomspace(0.5, 2, 30), 12.0)] * 3), kinds)


def test_kinds_of_other_sizes_stay_apart() -> None:
    kinds = kinds_of([seen(np.full(20, 5.0), 200.0), seen(np.full(20, 300.0), 8.0)])
    assert likeliest(kinds, 200.0) == pytest.approx(5.0, rel=0.3)
    assert likeliest(kinds, 8.0) == pytest.approx(300.0, rel=0.3)


def test_without_lamps_nothing_is_learnt() -> None:
    kinds = kinds_of([])
    assert (kinds == kinds[0]).all()
    np.testing.assert_array_equal(kinds_of([seen(np.zeros(0), 1.0)]), kinds)


def test_a_colour_is_told_by_a_rim_on_plain_ground_and_assumed_on_any_other() -> None:
    cyan = np.array([[0.3, 1.0, 0.9]])
    plain, busy = (tints(cyan, np.array([doubt]))[0] for doubt in (0.0, 3.0))
    assert plain[0] < 0.5
    assert busy.argmax() == 0
    assert busy.min() > 0.5
