"""The smoothed path of a camera: what it keeps, what it takes away, and that the clip shows what it sees."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.camera.steady_path import MOST_ZOOM, SteadyPath, steady_path, zoomed

CAMERA = Intrinsics(640, 360, 600.0, 600.0, 320.0, 180.0)
FISHEYE = Intrinsics(640, 360, 600.0, 600.0, 320.0, 180.0, k1=-0.1, k2=0.02)
FRAMES = 90


def carried(shake: float, camera: Intrinsics = CAMERA) -> Reconstruction:
    """A walk to the right past points 4 to 20 units away, with so many units and radians of tremor; the
    hand's turns are those of all 90 frames, the fifth of them without a solved camera."""
    rng = np.random.default_rng(5)
    xyz = np.column_stack([rng.uniform(-6, 9, 400), rng.uniform(-3, 3, 400), rng.uniform(4, 20, 400)])
    along = np.linspace(0, 1, FRAMES)
    centres = along[:, None] * [0.8, 0.0, 0.1] + shake * rng.normal(size=(FRAMES, 3))
    turns = along[:, None] * [0.0, 0.1, 0.0] + shake * rng.normal(size=(FRAMES, 3))
    images = []
    for frame, (centre, turn) in enumerate(zip(centres, turns, strict=True), start=1):
        rotation = rotation_matrix(turn)
        local = (xyz - centre) @ rotation.T
        xy = camera.project(local)
        seen = np.flatnonzero((local[:, 2] > 0) & np.all((xy > 0) & (xy < [640, 360]), axis=1)).astype(
            np.int32
        )
        images.append(Image(frame, rotation, -rotation @ centre, xy[seen], seen))
    points = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
    return Reconstruction((camera,), tuple(image for image in images if image.frame != 5), points)


def accelerations(centres: Floats) -> float:
    return float(np.sqrt(np.mean(np.diff(centres, 2, axis=0) ** 2)))


def own_centres(clip: Reconstruction, path: SteadyPath) -> Floats:
    return np.array([clip.image_at(int(frame))[0].centre for frame in path.frames])


def test_a_steady_walk_stays_as_it_is() -> None:
    clip = carried(0.0)
    path = steady_path(clip, 0.5)
    assert path.strength == 0.5 and path.zoom < 1.001
    assert np.allclose(path.centres, own_centres(clip, path), atol=1e-6)


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE], ids=["pinhole", "distorted"])
def test_shake_goes_and_the_clip_shows_all_that_is_seen(camera: Intrinsics) -> None:
    clip = carried(0.004, camera)
    path = steady_path(clip, 0.5)
    assert accelerations(path.centres) < 0.05 * accelerations(own_centres(clip, path))
    assert 1 < path.zoom <= MOST_ZOOM and len(path.frames) == FRAMES
    assert np.allclose(path.rotations @ path.rotations.swapaxes(1, 2), np.eye(3), atol=1e-12)
    # Whatever lies at points of the clip's depths on the rim of the steadier picture, the clip's frame has.
    steady = zoomed(camera, path.zoom)
    rim = np.array([[0.0, 0.0], [640.0, 0.0], [0.0, 360.0], [640.0, 360.0], [320.0, 0.0]])
    rays = np.column_stack([steady.undistort((rim - steady.principal_point) / steady.focal), np.ones(5)])
    for row, frame in enumerate(path.frames):
        image, _ = clip.image_at(int(frame))
        for depth in (6.0, 15.0):
            world = path.centres[row] + (rays * depth) @ path.rotations[row]
            seen = camera.project(image.to_camera(world))
            assert np.all((seen > -0.1) & (seen < np.array([640, 360]) + 0.1))


def test_at_full_strength_the_camera_moves_on_a_line() -> None:
    path = steady_path(carried(0.002), 1.0)
    assert path.strength == 1 and accelerations(path.centres) < 1e-12


def test_a_path_that_the_clip_does_not_show_is_smoothed_less() -> None:
    path = steady_path(carried(0.05), 1.0)
    assert path.strength < 1 and path.zoom <= MOST_ZOOM
