"""Passes for compositing: their values against the planes of a known scene, and in Blender's files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene import passes
from addon.scene.build import build
from addon.scene.sources.shot import reconstruction_of

from ..pictures import channels
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
DISTANCE, RADIUS = 8.0, 0.4


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius = DISTANCE, RADIUS
    settings.method, settings.views = "features", 4
    scene.frame_set(2)
    return scene


def rendered(scene: bpy.types.Scene, file: Path) -> dict[str, np.ndarray]:
    """Passes of the view layer besides Combined as they are in a file, (H, W)."""
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "NONE"
    # One part for all passes.
    scene.render.image_settings.use_exr_interleave = True
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    found = {name.split(".")[1]: pixels for name, pixels in channels(file).items()}
    found.pop("Combined")
    return found


def test_values_of_a_plane(solved: bpy.types.Scene, tmp_path: Path) -> None:
    layer = solved.view_layers[0]
    layer.use_pass_z = True
    layer.virtual_aperture_passes.use_circle_of_confusion = True
    layer.virtual_aperture_passes.use_in_focus = True
    found = rendered(solved, tmp_path / "all.exr")
    assert set(found) == {passes.DEPTH, passes.CIRCLE_OF_CONFUSION, passes.IN_FOCUS}
    depth, disc = found[passes.DEPTH], found[passes.CIRCLE_OF_CONFUSION]
    reconstruction = reconstruction_of(solved.virtual_aperture)
    image, _ = reconstruction.image_at(2)
    xyz = image.to_camera(reconstruction.points.xyz)
    x, y = (LENS.fx * xyz[:, 0] / xyz[:, 2] + LENS.cx, LENS.fy * xyz[:, 1] / xyz[:, 2] + LENS.cy)
    seen = (x > 2) & (x < 158) & (y > 2) & (y < 88)
    # Blender's first row is the top one in a file.
    at = depth[y[seen].astype(int), x[seen].astype(int)]
    assert np.abs(at / xyz[seen, 2] - 1).max() < 0.02
    expected = 2 * RADIUS * LENS.fx * (1 / depth - 1 / DISTANCE)
    assert np.allclose(disc, expected, atol=1e-3)
    assert disc.min() < -1 and disc.max() > 1
    matte = found[passes.IN_FOCUS]
    assert matte.min() == 0 and matte.max() == 1
    assert (matte[np.abs(disc) < 0.1] == 1).all() and (matte[np.abs(disc) > 0.3] == 0).all()


def test_discs_are_in_pixels_of_what_is_rendered(solved: bpy.types.Scene, tmp_path: Path) -> None:
    solved.view_layers[0].virtual_aperture_passes.use_circle_of_confusion = True
    whole = rendered(solved, tmp_path / "whole.exr")[passes.CIRCLE_OF_CONFUSION]
    solved.render.resolution_percentage = 50
    half = rendered(solved, tmp_path / "half.exr")[passes.CIRCLE_OF_CONFUSION]
    assert half.shape == (45, 80)
    inside = np.s_[5:-5, 5:-5]
    assert np.allclose(half[inside], (whole.reshape(45, 2, 80, 2).mean(axis=(1, 3)) / 2)[inside], atol=0.05)


def test_a_border_is_cut_out_of_passes(solved: bpy.types.Scene, tmp_path: Path) -> None:
    solved.view_layers[0].use_pass_z = True
    whole = rendered(solved, tmp_path / "whole.exr")[passes.DEPTH]
    render = solved.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.25, 0.75
    render.border_min_y, render.border_max_y = 0.0, 0.5
    part = rendered(solved, tmp_path / "part.exr")[passes.DEPTH]
    assert np.array_equal(part, whole[45:, 40:120])
