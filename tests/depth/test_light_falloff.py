"""The light that a lens loses towards the corners, and depth there as a camera moves ahead over a ground."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.light_falloff import light_falloff
from addon.core.depth.multi_view_stereo import PlaneSweepStereo

from .. import planes

LENS = Intrinsics(320, 180, 290.0, 290.0, 160.0, 90.0)
GROUND = 1.0
"""Height of the camera."""
HORIZON = 12
"""Rows between the picture's middle and the farthest ground that is looked at."""
TEXELS = 90
"""A scene unit of the ground."""
WALK = np.linspace(-1.2, 1.2, 17)
"""Places of the camera along its way; the middle one is at 0."""
MIDDLE = 9
"""Its frame."""


def ground_inverse() -> Floats:
    """(h, w) inverse depth of the ground below the horizon, that of a wall above it."""
    down = (np.arange(LENS.height) + 0.5 - LENS.cy) / LENS.fy
    rows = np.maximum(down, HORIZON / LENS.fy) / GROUND
    return np.repeat(rows[:, None], LENS.width, axis=1)


def left(darkness: float) -> Floats:
    """(h, w) share of the light that a lens leaves, all in the middle, `1 - darkness` in the corners."""
    y, x = np.mgrid[: LENS.height, : LENS.width] + 0.5
    distance = np.hypot(x - LENS.cx, y - LENS.cy) / np.hypot(LENS.cx, LENS.cy)
    return np.asarray(1 - darkness * distance**3)


def view(ahead: float, darkness: float, seed: int) -> NDArray[np.uint8]:
    """(h, w, 3) what a camera `ahead` along its way sees of the ground, and a wall where it ends."""
    inverse = ground_inverse()
    far = GROUND * LENS.fy / HORIZON
    y, x = np.mgrid[: LENS.height, : LENS.width] + 0.5
    ray_x, ray_y = (x - LENS.cx) / LENS.fx, (y - LENS.cy) / LENS.fy
    # The wall stands still as the camera moves on: rows near the horizon reach it sooner.
    on_wall = ray_y * (far - ahead) < GROUND
    depth = np.where(on_wall, far - ahead, GROUND / np.maximum(ray_y, 1e-6))
    ground = planes.pattern(3200, 3200, seed)
    wall = planes.pattern(1600, 800, seed + 1)
    across = ray_x * depth
    floor = cv2.remap(
        ground, np.float32(1600 + TEXELS * across), np.float32(300 + TEXELS * (depth + ahead)), cv2.INTER_AREA
    )
    back = cv2.remap(
        wall, np.float32(800 + 12 * across), np.float32(400 + 12 * ray_y * depth), cv2.INTER_AREA
    )
    seen = 0.5 + 0.3 * (np.where(on_wall, back, floor) / 255.0 - 0.5)
    noise = np.random.default_rng(seed + round(1000 * abs(ahead))).normal(0, 1, inverse.shape)
    encoded = 255 * (seen**2.2 * left(darkness)) ** (1 / 2.2) + noise
    return np.repeat(np.clip(np.rint(encoded), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def walk(seed: int) -> Reconstruction:
    """Cameras along the way, and points of the ground that each of them sees."""
    rng = np.random.default_rng(seed)
    depth = 1 / rng.uniform(0.09, 0.33, 300)
    xyz = np.column_stack([rng.uniform(-0.6, 0.6, 300) * depth, np.full(300, GROUND), depth])
    images = []
    for frame, ahead in enumerate(WALK, start=1):
        place = np.array([0, 0, ahead])
        xy = LENS.project(xyz - place)
        inside = np.nonzero(
            ((xy > 0) & (xy < [LENS.width, LENS.height])).all(axis=1) & (xyz[:, 2] > ahead + 0.5)
        )[0]
        images.append(Image(frame, np.eye(3), -place, xy[inside], inside.astype(np.int32)))
    return Reconstruction((LENS,), tuple(images), Points(xyz, np.zeros((300, 3), np.uint8), np.zeros(300)))


@pytest.mark.parametrize(("darkness", "seed"), [(0.0, 3), (0.45, 0), (0.52, 1), (0.6, 2)])
def test_the_ground_in_dark_lower_corners_has_its_depth(darkness: float, seed: int) -> None:
    pictures = {frame: view(ahead, darkness, 10 * seed) for frame, ahead in enumerate(WALK, start=1)}
    found = PlaneSweepStereo(walk(seed), pictures.__getitem__).at(MIDDLE)
    true = ground_inverse()
    corners = np.zeros(true.shape, bool)
    corners[-45:-4, 4:45] = corners[-45:-4, -45:-4] = True
    off = np.abs(found.inverse_depth - true) > 0.1 * true
    assert off[corners].mean() < 0.01


@pytest.mark.parametrize("darkness", [0.0, 0.05, 0.3, 0.45, 0.6])
def test_the_loss_is_found_where_there_is_one(darkness: float) -> None:
    solve, seen = walk(0), []
    for image in solve.images[::4]:
        picture = view(-image.translation[2], darkness, 0)
        rgba = np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])
        seen.append((rgba, LENS, LENS.project(solve.points.xyz + image.translation)))
    found = light_falloff(seen)
    if darkness < 0.1:
        assert found is None
        return
    assert found is not None
    distance = np.linspace(0, found.outermost, 20)
    encoded = np.log(1 - darkness * distance**3) / 2.2
    np.testing.assert_allclose(found.left(distance), encoded, atol=0.06)
