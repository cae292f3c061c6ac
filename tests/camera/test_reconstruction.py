"""Lens model, rotations, normalising, and poses of frames that were not registered."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.camera.reconstruction import (
    MEDIAN_DEPTH,
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    matrix_from_quaternion,
    normalise,
    quaternion_from_matrix,
    rotation_matrix,
    rotation_vector,
)

LENS = Intrinsics(640, 480, 500.0, 510.0, 325.0, 236.0, k1=-0.08, k2=0.02, p1=0.001, p2=-0.002)


def scene(frames: tuple[int, ...] = (1, 2, 5), points: int = 40) -> Reconstruction:
    random = np.random.default_rng(3)
    xyz = random.uniform([-2, -2, 4], [2, 2, 9], (points, 3))
    images = []
    for frame in frames:
        rotation = rotation_matrix(np.array([0.02, 0.03 * frame, -0.01]))
        translation = -rotation @ np.array([0.1 * frame, 0.02 * frame, 0.0])
        xy = LENS.project(xyz @ rotation.T + translation)
        images.append(Image(frame, rotation, translation, xy, np.arange(points, dtype=np.int32)))
    rgb = random.integers(0, 256, (points, 3)).astype(np.uint8)
    return Reconstruction((LENS,), tuple(images), Points(xyz, rgb, np.zeros(points)))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, np.pi - 1e-7, np.pi])
def test_rotations_survive_every_form(angle: float) -> None:
    for axis in [*np.eye(3), np.array([1.0, -2.0, 3.0]) / np.sqrt(14)]:
        matrix = rotation_matrix(angle * axis)
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
        np.testing.assert_allclose(matrix_from_quaternion(quaternion_from_matrix(matrix)), matrix, atol=1e-14)
        np.testing.assert_allclose(rotation_matrix(rotation_vector(matrix)), matrix, atol=1e-14)


def test_normalise_moves_the_scene_and_not_the_picture() -> None:
    before = scene()
    after = normalise(before)
    for old, new in zip(before.images, after.images, strict=True):
        projected = LENS.project(new.to_camera(after.points.xyz))
        np.testing.assert_allclose(projected, LENS.project(old.to_camera(before.points.xyz)), atol=1e-9)
    np.testing.assert_allclose(np.mean([i.centre for i in after.images], axis=0), 0, atol=1e-12)
    distances = np.linalg.norm(after.points.xyz, axis=1)
    assert np.median(distances) == pytest.approx(MEDIAN_DEPTH)
    up = -np.mean([i.rotation[1] for i in after.images], axis=0)
    assert up[2] > 0 and np.abs(up[:2]).max() < 1e-12


def test_a_missing_frame_lies_between_its_neighbours() -> None:
    shot = scene()
    image, interpolated = shot.image_at(3)
    assert interpolated and image.frame == 3
    np.testing.assert_allclose(image.centre, [0.3, 0.06, 0.0], atol=1e-12)
    np.testing.assert_allclose(image.rotation @ image.rotation.T, np.eye(3), atol=1e-12)
    expected = LENS.project(image.to_camera(shot.points.xyz[image.points]))
    np.testing.assert_allclose(image.xy, expected)


def test_a_frame_outside_the_solved_range_takes_the_nearest_pose() -> None:
    shot = scene()
    for frame, nearest in ((0, 0), (9, -1)):
        image, interpolated = shot.image_at(frame)
        assert interpolated and image.frame == frame
        np.testing.assert_allclose(image.centre, shot.images[nearest].centre, atol=1e-12)
