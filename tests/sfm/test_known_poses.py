"""Points before cameras that are held: on the planes that were filmed; and cameras of something else."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import (
    NO_POINTS,
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    rotation_matrix,
)
from addon.core.media.clip import open_footage
from addon.core.sfm.mapping.known_poses import thinned, triangulate
from addon.core.sfm.tracking.tracks import Tracks, track_features

from .. import camera_files as files
from .. import planes


@pytest.fixture(scope="module")
def tracks(tmp_path_factory: pytest.TempPathFactory) -> Tracks:
    clip = files.write_clip(tmp_path_factory.mktemp("known") / "shot")
    return track_features(open_footage(clip))


def renumbered(known: Reconstruction, by: int) -> Reconstruction:
    return replace(known, images=tuple(replace(image, frame=image.frame + by) for image in known.images))


def test_points_lie_on_what_was_filmed(tracks: Tracks) -> None:
    """Whichever way the world lies, and whatever its unit: lengths are the cameras' own."""
    turn, scale = rotation_matrix(np.array([0.4, -1.1, 0.7])), 0.3
    known = triangulate(files.model(turn, scale), tracks)
    found = known.reconstruction
    depth = (found.points.xyz @ turn)[:, 2] / scale
    nearest = np.min([np.abs(depth / there - 1) for there in planes.PLANES], axis=0)
    assert len(depth) > 150
    assert np.median(nearest) < 0.005 and np.quantile(nearest, 0.9) < 0.02
    for there in planes.PLANES:
        assert np.sum(np.abs(depth / there - 1) < 0.02) > 10
    assert known.miss < 0.3 and known.explained > 0.8
    assert found.frames.tolist() == list(range(1, files.COUNT + 1))
    # What is said of the error is what the points miss by in the pixels of the clip.
    total, seen = np.zeros(len(depth)), found.views_per_point
    for image in found.images:
        place = found.intrinsics(image).project(image.to_camera(found.points.xyz[image.points]))
        np.add.at(total, image.points, np.linalg.norm(place - image.xy, axis=1))
    np.testing.assert_allclose(total / seen, found.points.error, atol=1e-6)
    assert seen.min() >= 3


def test_a_lens_that_bends_is_undone(tracks: Tracks) -> None:
    """Tracks as such a lens would have shown them; the points are the same."""
    straight = triangulate(files.model(), tracks).reconstruction
    plain = files.camera()
    bent = replace(plain, k1=-0.12, k2=0.03, p1=0.002, fx=1.04 * plain.fx, fy=0.98 * plain.fy)
    rays = (tracks.xy - plain.principal_point) / plain.focal
    seen = replace(tracks, xy=bent.distort(rays) * bent.focal + bent.principal_point)
    found = triangulate(replace(files.model(), cameras=(bent,)), seen).reconstruction
    assert abs(len(found.points) - len(straight.points)) < 0.05 * len(straight.points)
    depths = [np.quantile(each.points.xyz[:, 2], [0.1, 0.5, 0.9]) for each in (found, straight)]
    np.testing.assert_allclose(*depths, rtol=0.01)


@pytest.mark.parametrize("offset", [-3, 2, 1000])
def test_other_frame_numbers_are_refused_with_those_that_fit(tracks: Tracks, offset: int) -> None:
    """Cameras from before the clip to after it, numbered otherwise, as of a scene that begins at 1001."""
    with pytest.raises(
        UserError, match=rf"to other frames of the clip.*{re.escape(f'(offset {offset:+d}: ')}"
    ):
        triangulate(renumbered(_longer(), offset), tracks)
    assert triangulate(_longer(), tracks).explained > 0.8


def _longer() -> Reconstruction:
    """The cameras of the clip, and five before and after it that go on along a bent path."""
    known = files.model()
    extra = []
    for step, number in [
        *zip(range(-5, 0), range(-4, 1), strict=True),
        *zip(range(1, 6), range(13, 18), strict=True),
    ]:
        end = known.images[0 if step < 0 else -1]
        turn = rotation_matrix(np.array([0.004 * step * step, 0.01 * step, 0.0])) @ end.rotation
        centre = end.centre + np.array([0.05 * step, 0.02 * step * step, 0.0])
        extra.append(Image(number, turn, -turn @ centre, np.zeros((0, 2)), np.zeros(0, np.int32)))
    images = sorted([*known.images, *extra], key=lambda image: image.frame)
    return replace(known, images=tuple(images))


def test_another_lens_is_refused_with_the_factor_that_fits(tracks: Tracks) -> None:
    lens = files.camera()
    longer = replace(files.model(), cameras=(replace(lens, fx=1.6 * lens.fx, fy=1.6 * lens.fy),))
    with pytest.raises(UserError, match=r"another lens than the clip: they fit with 0\.6\d times"):
        triangulate(longer, tracks)


@pytest.mark.parametrize(
    "axes",
    [np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0]), np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])],
)
def test_cameras_with_other_axes_are_refused(tracks: Tracks, axes: np.ndarray) -> None:
    """Those of OpenGL taken for OpenCV's, for one."""
    known = files.model()
    turned = tuple(
        replace(image, rotation=axes @ image.rotation, translation=axes @ image.translation)
        for image in known.images
    )
    with pytest.raises(UserError, match="do not belong to this clip"):
        triangulate(replace(known, images=turned), tracks)


def test_cameras_of_another_clip_are_refused(tracks: Tracks) -> None:
    """A walk ahead that looks about."""
    images = []
    for image in files.model().images:
        rotation = rotation_matrix(np.array([0.03 * image.frame, -0.02 * image.frame, 0.0]))
        centre = np.array([0.0, 0.0, 0.2 * image.frame])
        images.append(replace(image, rotation=rotation, translation=-rotation @ centre))
    with pytest.raises(UserError, match="do not belong to this clip"):
        triangulate(replace(files.model(), images=tuple(images)), tracks)


def test_cameras_that_only_turn_tell_no_depth(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "pan", planes.turning(8))
    angles = np.linspace(-0.12, 0.12, 8)
    images = []
    for number, angle in enumerate(angles, 1):
        rotation = rotation_matrix(np.array([0.0, angle, 0.0]))
        images.append(Image(number, rotation, np.zeros(3), np.zeros((0, 2)), np.zeros(0, np.int32)))
    known = replace(planes.poses(np.zeros((8, 3))), images=tuple(images))
    with pytest.raises(UserError, match="shows no depth"):
        triangulate(known, track_features(open_footage(clip)))


def _cloud(observed: bool) -> Reconstruction:
    """10,000 points a frame on the planes, as networks unproject depth: each is seen by its frame at most."""
    known, lens, found, xyz = files.model(), files.camera(), [], []
    random = np.random.default_rng(5)
    for number, image in enumerate(known.images):
        place = random.uniform([0, 0], planes.SIZE, (10_000, 2))
        rays = np.column_stack([(place - lens.principal_point) / lens.focal, np.ones(len(place))])
        world = rays @ image.rotation
        depth = (10.0 - image.centre[2]) / world[:, 2]
        xyz.append(image.centre + world * depth[:, None])
        rows = np.arange(number * 10_000, (number + 1) * 10_000, dtype=np.int32)
        found.append(replace(image, xy=place, points=rows) if observed else image)
    points = np.concatenate(xyz)
    grey = np.full((len(points), 3), 128, np.uint8)
    return replace(known, images=tuple(found), points=Points(points, grey, np.zeros(len(points))))


@pytest.mark.parametrize("observed", [True, False])
def test_a_cloud_of_depth_is_thinned_to_what_focus_needs(observed: bool) -> None:
    cloud = thinned(_cloud(observed))
    assert len(cloud.points) < 25_000
    np.testing.assert_allclose(cloud.points.xyz[:, 2], 10.0)
    for image in cloud.images:
        assert len(image.points) >= 300 if observed else len(image.points) > 1000
        assert np.bincount(image.points).max() == 1
        place = cloud.intrinsics(image).project(image.to_camera(cloud.points.xyz[image.points]))
        np.testing.assert_allclose(place, image.xy, atol=1e-9)
        # It is spread over the picture.
        cells = np.unique(np.floor(image.xy / planes.SIZE * 4), axis=0)
        assert len(cells) == 16


def test_a_walk_through_a_room(data: Path) -> None:
    """Real poses in metres, of a clip with blur and a glossy floor: they fit, one frame later they do not."""
    lens = np.loadtxt(data / "room" / "K.txt")
    camera = Intrinsics(540, 360, lens[0, 0], lens[1, 1], lens[0, 2] + 0.5, lens[1, 2] + 0.5)
    images = []
    for row in np.loadtxt(data / "room" / "poses.txt"):
        matrix = row[1:].reshape(4, 4)
        left, _, right = np.linalg.svd(matrix[:3, :3].T)
        rotation = left @ right
        images.append(Image(int(row[0]), rotation, -rotation @ matrix[:3, 3]))
    room = Reconstruction((camera,), tuple(images), NO_POINTS)
    tracks = track_features(open_footage(data / "room" / "images"))
    known = triangulate(room, tracks)
    found = known.reconstruction
    assert len(found.images) == 60 and len(found.points) > 2000
    assert known.miss < 1.0 and found.points.error.mean() < 0.6
    # A depth camera measured the same.
    middle = found.images[30]
    depth = cv2.imread(str(data / "room" / "depth" / f"{middle.frame:05d}.png"), cv2.IMREAD_UNCHANGED) / 1000
    column, row = np.floor(middle.xy / [540 / depth.shape[1], 360 / depth.shape[0]]).astype(int).T
    measured = depth[np.clip(row, 0, depth.shape[0] - 1), np.clip(column, 0, depth.shape[1] - 1)]
    there = measured > 0
    ratio = middle.to_camera(found.points.xyz[middle.points])[there, 2] / measured[there]
    assert len(ratio) > 50
    assert np.median(ratio) == pytest.approx(1, abs=0.03)
    with pytest.raises(UserError, match=r"to other frames of the clip.*\(offset -1: "):
        triangulate(renumbered(room, -1), tracks)
    longer = replace(camera, fx=1.3 * camera.fx, fy=1.3 * camera.fy)
    with pytest.raises(UserError, match=r"another lens than the clip: they fit with 0\.7\d times"):
        triangulate(replace(room, cameras=(longer,)), tracks)
