"""The table of a lens with a rolling shutter against its exact model."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.camera.intrinsics import Intrinsics
from addon.core.warp.source_view import pixels

SHUTTER = {"turn": (0.01, -0.02, 0.015), "largest_turn": 0.03, "readout": (0.0, 0.7)}
CAMERAS = {
    "straight": Intrinsics(1280, 720, 900.0, 900.0, 640.0, 360.0, **SHUTTER),
    "wide": Intrinsics(1280, 720, 700.0, 700.0, 650.0, 350.0, k1=-0.3, k2=0.08, **SHUTTER),
    "tall": Intrinsics(1080, 1920, 1500.0, 1500.0, 540.0, 960.0, k1=0.05, **SHUTTER),
}


@pytest.mark.parametrize("name", CAMERAS)
def test_it_is_exact_to_a_fiftieth_of_a_pixel(name: str) -> None:
    camera = CAMERAS[name]
    seen = np.random.default_rng(0).uniform([0, 0], [camera.width, camera.height], (5000, 2))
    rays = camera.undistort((seen - camera.principal_point) / camera.focal)
    found = np.stack(pixels(camera, *rays.astype(np.float32).T), axis=-1)
    assert np.abs(found - seen).max() < 0.02


def test_far_outside_nothing_is_seen() -> None:
    camera = CAMERAS["wide"]
    x, y = pixels(camera, np.array([9.0, 0.0], np.float32), np.array([0.0, 0.0], np.float32))
    assert np.isnan([x[0], y[0]]).all() and np.isfinite([x[1], y[1]]).all()


def test_a_global_shutter_is_computed() -> None:
    camera = Intrinsics(1280, 720, 900.0, 900.0, 640.0, 360.0, k1=-0.2)
    rays = np.random.default_rng(0).uniform(-0.5, 0.5, (100, 2)).astype(np.float32)
    expected = camera.distort(rays.astype(float)) * camera.focal + camera.principal_point
    np.testing.assert_allclose(np.stack(pixels(camera, *rays.T), axis=-1), expected, atol=1e-3)
