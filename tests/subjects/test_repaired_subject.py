"""Focus on a whole subject whose depth the user has repaired."""

from __future__ import annotations

from dataclasses import replace

import pytest

from addon.core.frame.repaired_depth import repaired_subject
from addon.core.frame.repairs import Repair
from addon.core.subjects.strokes import MarkedSubject, Stroke

from . import walls
from .walls import FRAMES, HEIGHT, NEAR, RADIUS, WIDTH, place

PAINTED = 16
X, Y = place(PAINTED)
DISC, FAR_WALL, NEAR_WALL = (X / WIDTH, Y / HEIGHT), (0.9, 0.1), (0.5, 0.9)
"""Places in the painted frame."""


@pytest.fixture(scope="module")
def clip() -> walls.Filmed:
    line = tuple(((X + across) / WIDTH, Y / HEIGHT) for across in (-10, 10))
    return replace(walls.filmed(walls.with_disc), marked=(MarkedSubject("disc", (Stroke(PAINTED, line),)),))


def repair(kind: str, at: tuple[float, float] = DISC, reference: tuple[float, float] | None = None) -> Repair:
    return Repair(kind, PAINTED, (at,), RADIUS / WIDTH, 1.0, reference)


@pytest.mark.long
def test_what_is_painted_nearer_is_followed_nearer(clip: walls.Filmed) -> None:
    before = clip.subject_place("disc", PAINTED)
    found = repaired_subject(clip, "disc", PAINTED, [repair("nearer")])
    assert found.distance == found.focus.distance == found.followed[PAINTED]
    assert sorted(found.followed) == list(FRAMES)
    for frame in FRAMES:
        assert found.followed[frame] == pytest.approx(before.followed[frame] / 2, rel=0.05), frame


@pytest.mark.long
def test_what_is_painted_as_the_near_wall_is_as_near(clip: walls.Filmed) -> None:
    found = repaired_subject(clip, "disc", PAINTED, [repair("same", reference=NEAR_WALL)])
    assert found.distance == pytest.approx(NEAR, rel=0.1)
    assert clip.subject_place("disc", PAINTED).distance > 1.5 * NEAR


@pytest.mark.parametrize("other", [repair("nearer", FAR_WALL), repair("sharp")])
def test_repairs_beside_it_and_sharp_ones_change_nothing(clip: walls.Filmed, other: Repair) -> None:
    assert repaired_subject(clip, "disc", PAINTED, [other]) == clip.subject_place("disc", PAINTED)
