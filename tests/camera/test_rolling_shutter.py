"""A picture that is read row by row while the camera turns, against the time at which each row is read."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.camera.steady_path import steady_path, zoomed
from addon.scene.solve import point_cloud
from addon.scene.sources.shot import reconstruction_digest

WIDTH, HEIGHT = 640, 360
TURN = (0.015, -0.04, 0.02)
READOUTS = {"rows": (0.0, 0.5), "upwards": (0.0, -0.5), "columns": (0.4, 0.0)}
LENSES = {
    "pinhole": Intrinsics(WIDTH, HEIGHT, 500.0, 500.0, 325.0, 170.0),
    "barrel": Intrinsics(WIDTH, HEIGHT, 500.0, 500.0, 325.0, 170.0, k1=-0.2, k2=0.05),
    "fisheye": Intrinsics(
        WIDTH, HEIGHT, 500.0, 500.0, 325.0, 170.0, model="OPENCV_FISHEYE", terms=(0.05, 0.01, 0.0, 0.0)
    ),
}


def read_at(lens: Intrinsics, readout: tuple[float, float], point: Floats) -> Floats:
    """(2,) where a point (3,) is read: by bisection of the times, each with a camera of its own."""

    def place(time: float) -> Floats:
        return lens.project(rotation_matrix(time * np.array(TURN)) @ point)

    def late(time: float) -> float:
        return float((place(time) / [lens.width, lens.height] - 0.5) @ np.array(readout)) - time

    low, high = -2.0, 2.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if late(middle) > 0 else (low, middle)
    return place(low)


@pytest.mark.parametrize("name", LENSES)
@pytest.mark.parametrize("readout", READOUTS.values(), ids=READOUTS)
def test_each_place_is_seen_by_the_camera_of_its_time(name: str, readout: tuple[float, float]) -> None:
    lens = LENSES[name]
    rolling = replace(lens, turn=TURN, readout=readout)
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(-0.6, 0.6, 40), rng.uniform(-0.33, 0.33, 40), np.ones(40)])
    points *= rng.uniform(1, 9, (40, 1))
    expected = np.array([read_at(lens, readout, point) for point in points])
    np.testing.assert_allclose(rolling.project(points), expected, rtol=0, atol=1e-6)
    # The places that rows give up are up to 6 pixels from where a picture taken at once has them.
    assert np.abs(expected - lens.project(points)).max() > 3
    rays = points[:, :2] / points[:, 2:]
    np.testing.assert_allclose(rolling.undistort(rolling.distort(rays)), rays, rtol=0, atol=1e-9)


def shaken(readout: tuple[float, float]) -> Reconstruction:
    """A camera that trembles by a degree and a half from frame to frame; frame 4 has no pose."""
    rng = np.random.default_rng(3)
    xyz = np.column_stack([rng.uniform(-6, 9, 300), rng.uniform(-3, 3, 300), rng.uniform(8, 20, 300)])
    images = []
    for frame in range(1, 41):
        rotation = rotation_matrix(0.02 * rng.normal(size=3))
        local = (xyz - [0.001 * frame, 0, 0]) @ rotation.T
        seen = np.flatnonzero(local[:, 2] > 0).astype(np.int32)
        centre = np.array([0.001 * frame, 0, 0])
        images.append(
            Image(frame, rotation, -rotation @ centre, LENSES["pinhole"].project(local[seen]), seen)
        )
    points = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    frames = tuple(image for image in images if image.frame != 4)
    return Reconstruction((LENSES["pinhole"],), frames, points, readout=readout)


def test_frames_turn_as_their_neighbours_stand() -> None:
    clip = shaken((0.0, 0.5))
    before, image, after = clip.images[9:12]
    camera = clip.intrinsics(image)
    assert camera.readout == (0.0, 0.5)
    np.testing.assert_allclose(
        rotation_matrix(2 * np.array(camera.turn)), after.rotation @ before.rotation.T, atol=1e-12
    )
    assert np.isfinite(clip.intrinsics(clip.image_at(4)[0]).turn).all()
    sizes = {Canvas(clip.intrinsics(each)).pinhole.read_at_once() for each in clip.images}
    assert len(sizes) == 1
    # Without a rolling shutter, or where the camera holds still, nothing is resampled.
    assert not shaken((0.0, 0.0)).intrinsics(image).is_distorted
    still = tuple(replace(each, rotation=np.eye(3)) for each in clip.images)
    assert not replace(clip, images=still).intrinsics(still[5]).is_distorted


def test_a_steadier_path_is_seen_at_once_and_wholly() -> None:
    clip = shaken((0.0, 0.6))
    path = steady_path(clip, 0.5)
    assert path.strength > 0
    rim = np.array([[0.0, 0.0], [WIDTH, 0.0], [0.0, HEIGHT], [WIDTH, HEIGHT], [WIDTH / 2, 0.0]])
    reach = []
    for row, frame in enumerate(path.frames):
        image, _ = clip.image_at(int(frame))
        camera = clip.intrinsics(image)
        steady = zoomed(camera, path.zoom)
        assert not steady.is_distorted
        rays = np.column_stack([(rim - steady.principal_point) / steady.focal, np.ones(len(rim))])
        world = path.centres[row] + 12 * rays @ path.rotations[row]
        reach.append(camera.project(image.to_camera(world)))
    assert np.min(reach) > -0.1 and np.all(np.max(reach, axis=(0, 1)) < [WIDTH + 0.1, HEIGHT + 0.1])


def test_a_blend_keeps_how_a_clip_was_read() -> None:
    clip = shaken((0.0, 0.35))
    mesh = bpy.data.meshes.new("points")
    point_cloud.write(mesh, clip)
    found = point_cloud.read(mesh)
    assert found.readout == (0.0, 0.35)
    assert reconstruction_digest(found) == reconstruction_digest(clip)
    assert reconstruction_digest(replace(clip, readout=(0.0, 0.0))) != reconstruction_digest(clip)


def folds(camera: Intrinsics) -> bool:
    """Whether a lens folds its picture: by the derivative of lens and shutter at every tenth pixel."""
    x, y = np.meshgrid(np.linspace(0, WIDTH, 65), np.linspace(0, HEIGHT, 37))
    rays = (camera.pinhole_pixels(np.stack([x, y], axis=-1)) - camera.principal_point) / camera.focal
    step = 1e-6
    with np.errstate(invalid="ignore"):
        moved = [(camera.distort(rays + d) - camera.distort(rays - d)) / (2 * step) for d in step * np.eye(2)]
        return not bool(np.all(np.linalg.det(np.stack(moved, axis=-1)) > 0))


@pytest.mark.parametrize("name", LENSES)
def test_a_shutter_slower_than_the_picture_is_refused(name: str) -> None:
    found = {True: 0, False: 0}
    for direction in ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.6, 0.0, -0.8), (0.0, 1.0, 0.0)):
        for angle in (0.05, 0.3, 0.45, 0.9, 1.2):
            turn = (angle * direction[0], angle * direction[1], angle * direction[2])
            rolling = replace(LENSES[name], turn=turn, readout=(0.0, 0.9))
            expected = folds(rolling)
            found[expected] += 1
            if expected:
                with pytest.raises(UserError, match="bends the picture's border"):
                    Canvas(rolling).pinhole  # noqa: B018
            else:
                assert Canvas(rolling).pinhole.width >= WIDTH
    assert min(found.values()) > 2
