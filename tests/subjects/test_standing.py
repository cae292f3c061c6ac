"""Where subjects stand on the ground."""

from __future__ import annotations

import pytest

from addon.core.base.arrays import Mask
from addon.core.subjects.standing import Standing

from .street import WALL, Street, person


def standing(*blind: int) -> Standing:
    return Standing(Street(frozenset(blind)), lambda frame: person(4.0, frame))  # type: ignore[arg-type]


def test_a_subject_is_as_far_as_the_ground_below_it() -> None:
    found = standing().inverse_depths(lambda frame: person(4.0, frame), [0, 1, 2])
    assert found == {frame: pytest.approx(1 / 4, rel=0.02) for frame in (0, 1, 2)}


def test_without_a_plane_a_subject_is_as_far_as_what_is_beneath_its_feet() -> None:
    found = standing(0, 1).inverse_depths(lambda frame: person(4.0, frame), [0, 1])
    assert found == {frame: pytest.approx(WALL) for frame in (0, 1)}


def test_a_frame_that_places_a_subject_behind_what_it_hides_is_left_out() -> None:
    street = Street(frozenset({0, 1, 2}), frozenset({1, 2}))
    for frames, there in (([0, 1, 2], {0: WALL}), ([1, 2], {})):
        place = Standing(street, lambda frame: person(4.0, frame))  # type: ignore[arg-type]
        assert place.inverse_depths(lambda frame: person(4.0, frame), frames) == pytest.approx(there)


def test_feature_points_tell_how_far_a_subject_is_that_stands_still() -> None:
    """Even where its place on the ground is wrong; a few points on someone who moves are errors."""
    for across, distance in ((8, 4.0), (1, 5.0)):
        place = Standing(Street(on_person=across), lambda frame: person(5.0, frame))  # type: ignore[arg-type]
        found = place.inverse_depths(lambda frame: person(5.0, frame), [0, 1])
        assert found == {frame: pytest.approx(1 / distance, rel=0.03) for frame in (0, 1)}, across


@pytest.mark.parametrize("distance", [1.5, 5.0])
def test_feature_points_off_the_ground_do_not_give_a_distance(distance: float) -> None:
    """Someone who walks along the camera's path has points that agree on a wrong distance."""
    street = Street(on_person=8, distance=distance)
    place = Standing(street, lambda frame: person(4.0, frame))  # type: ignore[arg-type]
    found = place.inverse_depths(lambda frame: person(4.0, frame), [0, 1])
    assert found == {frame: pytest.approx(1 / 4.0, rel=0.03) for frame in (0, 1)}


def test_unsteady_contact_with_the_ground_contradicts_no_feature_points() -> None:
    """The feet are seen at 4 in half of the frames, and at 5, as the points are, in the others."""
    street, seen = Street(on_person=8, distance=5.0), (4.0, 5.0, 4.0, 5.0)

    def mask(frame: int) -> Mask:
        return person(seen[frame], frame)

    found = Standing(street, mask).inverse_depths(mask, range(4))  # type: ignore[arg-type]
    assert found == {frame: pytest.approx(1 / 5.0, rel=0.03) for frame in range(4)}
