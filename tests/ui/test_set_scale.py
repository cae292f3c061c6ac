"""The scale by two clicks on the picture, or by how far away the subject is; and what is assumed before."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.scene.lens import scale
from addon.scene.sources.shot import Shot

from ..scenes import slanted_plane, slanted_shot, write_plane

LENS = Intrinsics(320, 180, 280.0, 280.0, 160.0, 90.0)
"""31.5 mm on a full frame."""
set_scale = bpy.ops.virtual_aperture.set_scale


@pytest.fixture
def settings(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.PropertyGroup:
    """The plane with so many points that four are near every place."""
    plane = slanted_plane(LENS, count=1500)
    made = Shot(open_footage(write_plane(tmp_path / "clip", plane)), plane)
    return build(scene, made.footage, made.reconstruction)


def on_the_plane(x: float) -> np.ndarray:
    """Where the first frame shows the plane, halfway down: its inverse depth is linear across the picture."""
    depth = 1 / ((1 - x) / 5 + x / 12)
    return np.array([(x - 0.5) * 320 / 280, 0.0, 1.0]) * depth


def test_two_clicks_and_a_length_are_the_scale(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup
) -> None:
    scene.frame_set(1)
    assert set_scale(start=(0.2, 0.5), end=(0.8, 0.5), metres=2.0) == {"FINISHED"}
    length = np.linalg.norm(on_the_plane(0.2) - on_the_plane(0.8))
    assert settings.metres_per_unit == pytest.approx(2.0 / length, rel=0.02)
    assert scene.unit_settings.scale_length == pytest.approx(settings.metres_per_unit)


def test_a_scale_is_refused(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        set_scale(metres=2.0)
    shot = slanted_shot(tmp_path, LENS)
    settings = build(scene, shot.footage, slanted_plane(LENS, count=1500))
    with pytest.raises(RuntimeError, match="both ends are in the same place"):
        set_scale(metres=2.0)
    # No texture, and too few points: a scale from a guess would look right.
    few = build(scene, shot.footage, slanted_plane(LENS, count=8))
    with pytest.raises(RuntimeError, match="the depth here is uncertain"):
        set_scale(start=(0.02, 0.02), end=(0.98, 0.98), metres=2.0)
    assert few.metres_per_unit == 0
    scene.frame_set(40)
    with pytest.raises(RuntimeError, match="frame 40 is after the end of the clip"):
        set_scale(start=(0.2, 0.5), end=(0.8, 0.5), metres=2.0)
    assert settings.metres_per_unit == 0


def test_an_f_stop_blurs_as_on_a_normal_lens_until_a_scale_is_given(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup
) -> None:
    settings.focus_distance = 8.0
    assert settings.metres_per_unit == 0
    metres = scale.scale(settings)
    # What lies in the median, by any frame: 2 m from 50 mm, and as the square of the focal length.
    reconstruction = slanted_plane(LENS, count=1500)
    depth = np.median(reconstruction.images[1].to_camera(reconstruction.points.xyz)[:, 2])
    assert metres * depth == pytest.approx(2.0 * (31.5 / 50) ** 2, rel=0.01)
    settings.f_stop = 2.0
    assert settings.f_stop == pytest.approx(2.0, rel=1e-5)
    # Of a lens of 50 mm at f/2, focused at 2 m, the disc of what is far away: f^2 / (N s) of 36 mm.
    settings.focus_distance = float(depth)
    settings.f_stop = 2.0
    share = 2 * settings.aperture_radius / depth * LENS.fx / LENS.width
    assert share == pytest.approx(50**2 / (2.0 * 2000) / 36, rel=0.01)
    # Another focus, or another frame, is no other scale.
    settings.focus_distance = 4.0
    scene.frame_set(3)
    assert scale.scale(settings) == metres


def test_how_far_the_subject_is_away_is_the_scale(
    scene: bpy.types.Scene, settings: bpy.types.PropertyGroup
) -> None:
    assert settings.subject_metres == 0
    settings.subject_metres = 3.0
    assert settings.metres_per_unit == 0, "nothing is in focus"
    settings.focus_distance = 8.0
    radius = settings.aperture_radius
    assert settings.subject_metres == pytest.approx(8.0 * scale.scale(settings))
    settings.subject_metres = 0.4
    assert settings.metres_per_unit == pytest.approx(0.05)
    assert settings.subject_metres == pytest.approx(0.4)
    assert settings.aperture_radius == radius, "the picture stays"
    assert settings.f_stop == pytest.approx(0.0315 / (2 * radius * 0.05), rel=1e-5)
