"""The user's depth maps on their way into the warp mesh."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import open_depth
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FrameOptions

from ..scenes import planned, slanted_shot

PLAIN = Intrinsics(160, 90, 150.0, 150.0, 80.0, 45.0)
BARREL = Intrinsics(160, 90, 150.0, 150.0, 80.0, 45.0, k1=-0.1)


def true_inverse_depth(camera: Intrinsics) -> np.ndarray:
    """(H, W) of the slanted plane in its first frame, from 1/5 to 1/12 over the picture's features."""
    shot_points = np.stack(np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5), -1)
    x = camera.undistort((shot_points - camera.principal_point) / camera.focal)[..., 0]
    rng = np.random.default_rng(3)
    seen = rng.uniform([0, 0], [camera.width, camera.height], (150, 2))
    rays = camera.undistort((seen - camera.principal_point) / camera.focal)[:, 0]
    share = (x - rays.min()) / np.ptp(rays)
    return (1 - share) / 5 + share / 12


@pytest.mark.parametrize("camera", [PLAIN, BARREL], ids=["plain", "barrel"])
@pytest.mark.parametrize("size", [(160, 90), (320, 180)], ids=["whole", "enlarged"])
def test_the_mesh_has_the_maps_depth(tmp_path: Path, camera: Intrinsics, size: tuple[int, int]) -> None:
    shot = slanted_shot(tmp_path / "clip", camera)
    truth = true_inverse_depth(camera)
    stored = np.round(20000 + 200000 * truth).astype(np.uint16)
    (tmp_path / "depth").mkdir()
    cv2.imwrite(str(tmp_path / "depth" / "d_0001.png"), stored)
    depth = UserDepth.of(open_depth(tmp_path / "depth", shot.footage), shot.reconstruction)
    settings = FrameOptions(Focus(distance=7.0), 0.3)
    plan = planned(shot.reconstruction, 1, settings, size, depth)
    canvas = Canvas(camera.scaled(*size))
    zoom = size[0] / camera.width
    inside = canvas.features_to_source(plan.mesh.xy) / zoom
    kept = np.all((inside > 1) & (inside < [camera.width - 1, camera.height - 1]), axis=1)
    column, row = np.floor(inside[kept]).astype(int).T
    # Where a disc is too small to be seen the mesh lies in the focal plane.
    out_of_focus = np.abs(truth[row, column] - 1 / 7) > 0.02
    found = plan.mesh.inverse_depth[kept][out_of_focus]
    assert len(found) > 500
    np.testing.assert_allclose(found, truth[row, column][out_of_focus], rtol=2e-3)


def test_a_frame_without_a_map_and_the_thesis_keep_their_features(tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", PLAIN)
    (tmp_path / "depth").mkdir()
    stored = np.round(20000 + 200000 * true_inverse_depth(PLAIN)).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "depth" / "d_0001.png"), stored)
    depth = UserDepth.of(open_depth(tmp_path / "depth", shot.footage), shot.reconstruction)
    for frame, method in ((2, "features"), (1, "thesis")):
        settings = FrameOptions(Focus(points=(1, 2, 3)), 0.3, 4, method)
        one = planned(shot.reconstruction, frame, settings, (160, 90), depth)
        other = planned(shot.reconstruction, frame, settings, (160, 90))
        np.testing.assert_array_equal(one.mesh.xy, other.mesh.xy)
        np.testing.assert_array_equal(one.mesh.inverse_depth, other.mesh.inverse_depth)
