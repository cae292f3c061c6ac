"""Where subjects stand on the ground."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map, Mask
from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import Image
from addon.core.subjects.standing import Standing

CAMERA = Intrinsics(320, 180, 260.0, 260.0, 160.0, 60.0)
EYE, WALL = 1.6, 0.05
"""Height of the camera over a level ground, and inverse depth of what is behind that."""


@dataclass(frozen=True)
class Street:
    """Plates of a street, seen from a place at each frame."""

    blind: frozenset[int] = frozenset()
    """Frames in which the ground is not seen."""
    deep: frozenset[int] = frozenset()
    """Those in which everything below the horizon is much too far, besides."""
    on_person: int = 0
    """Feature points across the person; there are 48 on both sides."""
    distance: float = 4.0
    """That of the points on the person."""

    @property
    def reconstruction(self) -> SimpleNamespace:
        sides = np.stack(np.meshgrid([-0.8, -0.7, 0.7, 0.8], np.linspace(-1, 1, 12), [4.5]), -1)
        own = np.stack(np.meshgrid(*(np.linspace(-0.15, 0.15, self.on_person),) * 2, [self.distance]), -1)
        xyz = np.concatenate([sides.reshape(-1, 3), own.reshape(-1, 3)])
        return SimpleNamespace(
            points=SimpleNamespace(xyz=xyz),
            intrinsics=lambda _image: CAMERA,
            image_at=lambda frame: (seeing(image(frame), xyz), None),
        )

    def canvas(self, frame: int) -> SimpleNamespace:
        return SimpleNamespace(
            pinhole=CAMERA, camera=CAMERA, features_from_source=lambda xy: (xy, np.ones(len(xy), bool))
        )

    def on_canvas(self, image: Image, mask: Mask) -> Mask:
        return mask

    def inverse_depth(self, frame: int, left_out: object) -> Map:
        rows = np.arange(CAMERA.height) + 0.5 - CAMERA.cy
        ground = np.maximum(rows / CAMERA.fy / EYE, WALL)
        inverse = np.full(CAMERA.height, WALL) if frame in self.blind else ground
        if frame in self.deep:
            inverse = np.where(rows < 90, inverse, WALL / 4)
        return np.repeat(inverse[:, None], CAMERA.width, axis=1).astype(np.float32)


def image(frame: int) -> Image:
    """A camera that moves to the right."""
    nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
    return Image(frame, np.eye(3), np.array([-0.2 * frame, 0.0, 0.0]), *nothing)


def seeing(image: Image, xyz: Floats) -> Image:
    """The camera with those of points (n, 3) that it sees."""
    there = xyz @ image.rotation.T + image.translation
    at = there[:, :2] / there[:, 2:] * CAMERA.focal + CAMERA.principal_point
    inside = ((at > 0) & (at < (CAMERA.width, CAMERA.height))).all(axis=1)
    return replace(image, xy=at[inside], points=np.flatnonzero(inside))


def person(distance: float, frame: int) -> Mask:
    """(h, w) someone at x = 0, 1.7 high."""
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    left, right = (round(CAMERA.cx + CAMERA.fx * (side - 0.2 * frame) / distance) for side in (-0.25, 0.25))
    foot, head = (round(CAMERA.cy + CAMERA.fy * y / distance) for y in (EYE, EYE - 1.7))
    mask[max(head, 0) : foot, left:right] = True
    return mask


def standing(*blind: int) -> Standing:
    return Standing(Street(frozenset(blind)), lambda frame: person(4.0, frame))  # type: ignore[arg-type]


def test_a_subject_is_as_far_as_the_ground_below_it() -> None:
    found = standing().inverse_depths(lambda frame: person(4.0, frame), [0, 1, 2])
    assert found == {frame: pytest.approx(1 / 4, rel=0.02) for frame in (0, 1, 2)}


def test_a_frame_without_a_plane_takes_that_of_another_one() -> None:
    found = standing(0, 2).inverse_depths(lambda frame: person(4.0 + frame / 2, frame), [0, 1, 2])
    assert found == {frame: pytest.approx(1 / (4.0 + frame / 2), rel=0.03) for frame in (0, 1, 2)}


def test_without_a_plane_a_subject_is_as_far_as_what_is_beneath_its_feet() -> None:
    found = standing(0, 1).inverse_depths(lambda frame: person(4.0, frame), [0, 1])
    assert found == {frame: pytest.approx(WALL) for frame in (0, 1)}


def test_a_frame_that_places_a_subject_behind_what_it_hides_is_left_out() -> None:
    street = Street(frozenset({0, 1, 2}), frozenset({1, 2}))
    for frames, there in (([0, 1, 2], {0: WALL}), ([1, 2], {1: WALL / 4, 2: WALL / 4})):
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


def test_without_feet_nothing_is_known() -> None:
    assert standing().inverse_depths(lambda frame: person(2.0, frame), [0]) == {}
    assert standing().inverse_depths(lambda frame: np.zeros_like(person(4.0, 0)), [0]) == {}
