"""How far a subject stands, through a clip."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.subjects.standing import StandingTrack

FRAMES = tuple(range(1, 61))


def true(frame: int) -> float:
    """Someone who comes nearer."""
    return 0.2 + 0.002 * frame


def test_a_subject_stays_where_it_is_while_its_feet_are_lifted_or_lost() -> None:
    def alone(frame: int) -> float | None:
        if 14 <= frame < 20:
            return 0.7 * true(frame)
        return None if 40 <= frame < 46 else true(frame)

    track = StandingTrack(FRAMES, alone)
    found = np.array([track.inverse_depth(frame) for frame in FRAMES], float)
    np.testing.assert_allclose(found, [true(frame) for frame in FRAMES], rtol=0.03)


def test_a_frame_is_the_same_whichever_was_asked_for_before() -> None:
    random = np.random.default_rng(3)
    noise = dict(zip(FRAMES, random.normal(0, 0.01, len(FRAMES)), strict=True))
    one, other = (StandingTrack(FRAMES, lambda frame: true(frame) + noise[frame]) for _ in range(2))
    backwards = {frame: other.inverse_depth(frame) for frame in reversed(FRAMES)}
    assert {frame: one.inverse_depth(frame) for frame in FRAMES} == backwards


def test_nothing_is_told_of_a_subject_that_stands_nowhere() -> None:
    assert StandingTrack(FRAMES, lambda frame: None).inverse_depth(9) is None
    once = StandingTrack(FRAMES, lambda frame: true(frame) if frame in (1, 4) else None)
    assert once.inverse_depth(2) == pytest.approx(true(2), rel=0.02) and once.inverse_depth(40) is None
