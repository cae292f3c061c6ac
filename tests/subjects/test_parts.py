"""Which parts of a mask are one subject's."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Map, Mask
from addon.core.subjects.parts import of_its_colours, without_islands

SHAPE = 60, 80
BODY, GROUND, HAND = np.s_[5:45, 10:30], np.s_[50:53, 12:16], np.s_[20:24, 33:37]
OTHER = np.s_[5:45, 50:70]


def mask(*parts: tuple[slice, slice]) -> Mask:
    found = np.zeros(SHAPE, bool)
    for part in parts:
        found[part] = True
    return found


def values(inside: float, *parts: tuple[slice, slice]) -> Map:
    return np.where(mask(*parts), inside, 0).astype(np.float32)


def test_what_flow_leaves_on_the_ground_is_dropped_and_a_hand_that_moves_is_not() -> None:
    whole = mask(BODY, GROUND, HAND)
    kept = without_islands(whole, whole, values(3.0, HAND), 0.03)
    assert np.array_equal(kept, mask(BODY, HAND))


def test_nothing_is_kept_where_the_subject_is_not_expected() -> None:
    kept = without_islands(mask(BODY, OTHER), mask(BODY), values(3.0, OTHER), 0.03)
    assert np.array_equal(kept, mask(BODY))


@pytest.mark.parametrize("mine, other", [(1.0, -1.0), (-0.3, -1.2)], ids=["surely", "hardly"])
def test_of_two_that_hang_together_no_more_the_one_of_other_colours_is_dropped(
    mine: float, other: float
) -> None:
    colours = values(mine, BODY) + values(other, OTHER)
    assert np.array_equal(of_its_colours(mask(BODY, OTHER), colours, 0.2), mask(BODY))


def test_what_is_of_its_colours_or_small_stays_whatever_it_hangs_together_with() -> None:
    colours = values(1.0, BODY, OTHER) + values(-1.0, HAND)
    whole = mask(BODY, OTHER, HAND)
    assert np.array_equal(of_its_colours(whole, colours, 0.2), whole)
    assert not of_its_colours(mask(), colours, 0.2).any()
