"""Points found in frames that did not track them, in a scene of three planes whose geometry is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Ints
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.sparse import frame_features
from addon.core.media.clip import Footage, open_footage
from addon.core.sfm.mapping.visibility import MIN_VIEWS, RADIUS, visible_points
from addon.core.sfm.tracking.klt import new_corners

from .. import planes

COUNT = 9
STEPS = np.linspace(-0.5, 0.5, COUNT)
CENTRES = np.array([[s, 0.2 * s * s, 0.1 * s] for s in STEPS])
TURNS = np.array([[0.01 * s, 0.04 * s, 0.0] for s in STEPS])
LENS = Intrinsics(*planes.SIZE, planes.FOCAL, planes.FOCAL, planes.SIZE[0] / 2, planes.SIZE[1] / 2)
MIDDLE = COUNT // 2


def rotation(index: int) -> NDArray[np.float64]:
    return cv2.Rodrigues(TURNS[index])[0]


def hit(index: int, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) where rays through pixels (n, 2) of a frame meet the nearest plane."""
    local = np.column_stack([(xy - LENS.principal_point) / LENS.focal, np.ones(len(xy))])
    rays = local @ rotation(index)
    world = np.full((len(xy), 3), np.nan)
    for depth, (left, right) in planes.PLANES.items():  # far to near
        there = CENTRES[index] + rays * ((depth - CENTRES[index, 2]) / rays[:, 2])[:, None]
        on = (there[:, 0] > left) & (there[:, 0] < right)
        world[on] = there[on]
    return world


def shown(index: int, world: NDArray[np.float64], slack: float) -> NDArray[np.bool_]:
    """(n,) whether points are inside a frame and not hidden; near an edge, by `slack` pixels either way."""
    local = (world - CENTRES[index]) @ rotation(index).T
    xy = LENS.project(local)
    seen = np.zeros(len(world), bool)
    for x in (-slack, 0, slack):
        seen |= np.linalg.norm(hit(index, xy + np.array([x, 0])) - world, axis=1) < 0.05 * world[:, 2]
    return seen & np.all((xy >= 0) & (xy <= planes.SIZE), axis=1)


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    return open_footage(planes.write_clip(tmp_path_factory.mktemp("planes") / "clip", planes.sideways(COUNT)))


@pytest.fixture(scope="module")
def world(footage: Footage) -> NDArray[np.float64]:
    """(m, 3) corners of the middle frame, where they are in space."""
    gray = cv2.cvtColor(footage.read(MIDDLE + 1), cv2.COLOR_RGB2GRAY)
    corners = new_corners(gray, np.zeros((0, 2), np.float32))
    return hit(MIDDLE, corners.astype(np.float64) + 0.5)


def reconstructed(world: NDArray[np.float64], observes: NDArray[np.bool_]) -> Reconstruction:
    """The true cameras and points; frame i observes those of (F, m)."""
    images = []
    for index, seen in enumerate(observes):
        points = np.nonzero(seen)[0].astype(np.int32)
        shift = -rotation(index) @ CENTRES[index]
        image = Image(index + 1, rotation(index), shift, np.zeros((len(points), 2)), points)
        images.append(replace(image, xy=LENS.project(image.to_camera(world[points]))))
    count = len(world)
    return Reconstruction(
        (LENS,), tuple(images), Points(world, np.zeros((count, 3), np.uint8), np.zeros(count))
    )


def lost_at_random(world: NDArray[np.float64]) -> Reconstruction:
    """Each point is observed in a run of frames around the middle where it is seen, and by no other."""
    rng = np.random.default_rng(1)
    first, last = rng.integers(0, MIDDLE - 1, len(world)), rng.integers(MIDDLE + 2, COUNT, len(world))
    frames = np.arange(COUNT)[:, None]
    seen = np.array([shown(index, world, 0) for index in range(COUNT)])
    return reconstructed(world, seen & (frames >= first) & (frames <= last))


@pytest.fixture(scope="module")
def found(footage: Footage, world: NDArray[np.float64]) -> tuple[Reconstruction, dict[int, Ints]]:
    reconstruction = lost_at_random(world)
    return reconstruction, visible_points(reconstruction, footage)


def test_what_is_seen_is_found_and_what_is_hidden_is_not(
    found: tuple[Reconstruction, dict[int, Ints]], world: NDArray[np.float64]
) -> None:
    reconstruction, visible = found
    known = reconstruction.views_per_point >= MIN_VIEWS
    right = wrong = there = 0
    for index, image in enumerate(reconstruction.images):
        points = visible[image.frame]
        surely = np.setdiff1d(
            np.nonzero(known & shown(index, world, 0) & ~hidden_near(index, world))[0], image.points
        )
        right += len(np.intersect1d(points, surely))
        there += len(surely)
        wrong += np.sum(~shown(index, world, 2)[points])
    total = sum(map(len, visible.values()))
    assert there > 500
    assert right > 0.85 * there
    assert wrong <= 0.01 * total


def hidden_near(index: int, world: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) whether something else is within the patch around a point."""
    local = (world - CENTRES[index]) @ rotation(index).T
    xy, reach = LENS.project(local), RADIUS + 2
    around = [hit(index, xy + np.array([x, 0]))[:, 2] for x in (-reach, reach)]
    return np.any([np.abs(z - world[:, 2]) > 0.1 for z in around], axis=0)


def test_nothing_is_found_twice(found: tuple[Reconstruction, dict[int, Ints]]) -> None:
    reconstruction, visible = found
    assert sorted(visible) == list(range(1, COUNT + 1))
    for image in reconstruction.images:
        each = visible[image.frame]
        assert (np.diff(each) > 0).all()
        assert not len(np.intersect1d(each, image.points))


def test_light_may_change(world: NDArray[np.float64], tmp_path: Path) -> None:
    clip = planes.sideways(COUNT)
    reconstruction = lost_at_random(world)
    plain = visible_points(reconstruction, open_footage(planes.write_clip(tmp_path / "plain", clip)))
    for index in range(0, COUNT, 2):
        clip[index] = (0.6 * clip[index] + 40).astype(np.uint8)
    lit = visible_points(reconstruction, open_footage(planes.write_clip(tmp_path / "lit", clip)))
    counts = [sum(map(len, visible.values())) for visible in (plain, lit)]
    assert counts[1] > 0.95 * counts[0]


def test_what_passes_in_front_hides(world: NDArray[np.float64], tmp_path: Path) -> None:
    # Something that no point tells of covers the left half of two frames; its texture is of the same kind.
    clip = planes.sideways(COUNT)
    for index in (1, 7):
        clip[index][:, :160] = planes.texture(160, 240, 30 + index)[..., None]
    reconstruction = lost_at_random(world)
    visible = visible_points(reconstruction, open_footage(planes.write_clip(tmp_path / "clip", clip)))
    for index in (1, 7):
        image, points = reconstruction.images[index], visible[index + 1]
        others = np.setdiff1d(np.nonzero(shown(index, world, 0))[0], image.points)
        place = LENS.project(image.to_camera(world))[:, 0]
        found, there = ([np.sum(place[rows] < 155), np.sum(place[rows] > 165)] for rows in (points, others))
        assert there[0] > 40 and found[0] < 0.1 * there[0]
        assert there[1] > 40 and found[1] > 0.8 * there[1]


def test_points_at_a_wrong_depth_or_none_are_left_out(footage: Footage, world: NDArray[np.float64]) -> None:
    reconstruction = lost_at_random(world)
    wrong = np.arange(len(world)) % 7 == 0
    xyz = world.copy()
    # On the ray of the middle frame, but nearer or farther than anything there.
    xyz[wrong] = (
        CENTRES[MIDDLE]
        + (world[wrong] - CENTRES[MIDDLE]) * np.where(np.arange(wrong.sum()) % 2 == 0, 0.5, 2.0)[:, None]
    )
    xyz[3] = np.nan
    moved = replace(reconstruction, points=replace(reconstruction.points, xyz=xyz))
    visible = visible_points(moved, footage)
    points = np.concatenate(list(visible.values()))
    assert len(points) > 300
    assert wrong[points].mean() < 0.01 and 3 not in points


def test_points_that_are_poorly_known_are_left_out(footage: Footage, world: NDArray[np.float64]) -> None:
    reconstruction = lost_at_random(world)
    error = np.where(np.arange(len(world)) % 3 == 0, 0.9, 0.3)
    measured = replace(reconstruction, points=replace(reconstruction.points, error=error))
    points = np.concatenate(list(visible_points(measured, footage).values()))
    assert len(points) > 300
    assert (points % 3 > 0).all()
    assert (measured.views_per_point[points] >= MIN_VIEWS).all()


def test_what_is_found_counts_among_a_frames_features(world: NDArray[np.float64]) -> None:
    reconstruction = lost_at_random(world)
    image = reconstruction.images[0]
    more = np.setdiff1d(np.arange(len(world)), image.points).astype(np.int32)[:40]
    images = (replace(image, visible=more), *reconstruction.images[1:])
    canvas = Canvas(LENS)
    before = frame_features(reconstruction, 1, canvas)
    after = frame_features(replace(reconstruction, images=images), 1, canvas)
    np.testing.assert_array_equal(after.points, np.concatenate([before.points, more]))
    local = image.to_camera(world[more])
    np.testing.assert_allclose(after.observed[-40:], LENS.project(local))
    np.testing.assert_allclose(after.inverse_depth[-40:], 1 / local[:, 2])


def test_without_points_nothing_is_found(footage: Footage) -> None:
    empty = reconstructed(np.zeros((0, 3)), np.zeros((COUNT, 0), bool))
    visible = visible_points(empty, footage)
    assert all(len(each) == 0 for each in visible.values())
    assert visible_points(replace(empty, images=()), footage) == {}
