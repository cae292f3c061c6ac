"""Clips in .blend files that work in other primaries than Rec.709 look as they do in one that does."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.picture_file import read_picture
from addon.render.output.frame_files import run_key
from addon.render.views.gpu_views import gpu_problem
from addon.scene.build import build
from addon.scene.sources.colour_space import REC_709, from_rec_709, working_space

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)

pytestmark = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")


def rendered(scene: bpy.types.Scene, out: Path) -> np.ndarray:
    """(90, 160, 3) uint8 as displayed."""
    scene.render.filepath = str(out)
    bpy.ops.render.render(write_still=True)
    return np.asarray(read_picture(out)[..., :3])


def test_a_frame_is_displayed_alike_in_every_working_space(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius, settings.method = 8.0, 0.2, "features"
    scene.view_settings.view_transform, scene.render.dither_intensity = "Standard", 0.0
    scene.frame_set(2)
    plain, keys = rendered(scene, tmp_path / "plain.png"), {run_key(scene)}
    # Pure colours are far from what other primaries make of the same three numbers.
    assert np.ptp(plain, axis=2).max() > 60
    for name in ("Linear Rec.2020", "ACEScg"):
        bpy.ops.wm.set_working_color_space(working_space=name)
        assert working_space() == name and from_rec_709() is not None
        found = rendered(scene, tmp_path / f"{name}.png")
        off = np.abs(found.astype(int) - plain)
        print(f"{name}: {off.max()} of 255, {off.mean():.2f} in the mean")
        # Blender rounds otherwise on the way back to Rec.709. Read as Rec.709 it would be 17 in the mean.
        assert off.max() <= 2 and off.mean() < 0.25
        keys.add(run_key(scene))
    bpy.ops.wm.set_working_color_space(working_space=REC_709)
    assert len(keys) == 3 and from_rec_709() is None
