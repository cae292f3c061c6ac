"""STMaps: what they say against the lens, and there and back again."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.camera.canvas import Canvas
from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.stmap import redistort_map, undistort_map

BARREL = Intrinsics(640, 360, 420.0, 430.0, 331.0, 170.0, k1=-0.15, k2=0.02, p1=0.001, p2=-0.002)
PINCUSHION = Intrinsics(640, 360, 520.0, 520.0, 320.0, 180.0, k1=0.12)
FISHEYE = Intrinsics(
    640, 360, 400.0, 400.0, 320.0, 180.0, model="OPENCV_FISHEYE", terms=(0.02, -0.01, 0.0, 0.0)
)


def sampled(stmap: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(h, w, 2) a map at u and v (h, w, 2) of its picture, linear between pixels, NaN outside of it."""
    height, width = stmap.shape[:2]
    at = np.stack([uv[..., 0] * width, (1 - uv[..., 1]) * height], axis=-1) - 0.5
    return cv2.remap(
        stmap, at.astype(np.float32), None, cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan, np.nan),
    )  # fmt: skip


def identity(width: int, height: int) -> np.ndarray:
    """The map that changes nothing, by its definition: pixel i of w is at (i + 0.5) / w, v is up."""
    u, v = (np.arange(width) + 0.5) / width, 1 - (np.arange(height) + 0.5) / height
    return np.stack(np.meshgrid(u, v), axis=-1)


@pytest.mark.parametrize("lens", [BARREL, PINCUSHION, FISHEYE], ids=["barrel", "pincushion", "fisheye"])
def test_there_and_back_is_where_one_was(lens: Intrinsics) -> None:
    canvas = Canvas(lens)
    back = sampled(undistort_map(canvas), redistort_map(canvas)) - identity(640, 360)
    error = np.hypot(back[..., 0] * 640, back[..., 1] * 360)
    # Every pixel of the frame has its place on the canvas, but for the outermost, between pixel centres.
    assert np.isfinite(error[1:-1, 1:-1]).all()
    assert np.nanmax(error) < 0.05


def test_a_lens_without_distortion_leaves_everything_in_its_place() -> None:
    canvas = Canvas(BARREL.without_distortion())
    for stmap in (undistort_map(canvas), redistort_map(canvas)):
        np.testing.assert_allclose(stmap, identity(640, 360), atol=1e-6)


def test_a_map_says_where_the_lens_shows_a_point() -> None:
    canvas = Canvas(BARREL)
    pinhole = canvas.pinhole
    assert pinhole.width > 640 and pinhole.height > 360
    ray = np.array([(700 + 0.5 - pinhole.cx) / pinhole.fx, (20 + 0.5 - pinhole.cy) / pinhole.fy, 1.0])
    x, y = BARREL.project(ray)
    u, v = undistort_map(canvas)[20, 700]
    assert (u * 640, (1 - v) * 360) == pytest.approx((x, y), abs=1e-3)
