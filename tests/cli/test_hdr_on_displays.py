"""HDR clips in pictures of 8 bits: mapped by ITU-R BT.2390's curve; what is SDR stays as it was."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.cli.blend import open_blend
from addon.core.media.picture_file import read_picture
from addon.core.media.tone_mapping import tone_mapped
from addon.render import engine
from addon.scene.sources import hdr_view

from ..media.colour_curves import HLG, PQ, Array, Recorded, write_clip
from .solved_clips import BRIGHT, SHOWN, filmed, imported, run


def pq(nits: Array) -> Array:
    power = np.maximum(nits / 10000, 0) ** 0.1593017578125
    return np.asarray(((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375)


def bt2390(light: Array) -> Array:
    """Report BT.2390-11, 5.4.1, steps 1 to 4 from 1,000 to 203 cd/m2, its light found by bisection."""
    top, least = pq(np.array(1000.0)), pq(np.array(203.0)) / pq(np.array(1000.0))
    e1 = np.clip(pq(203 * light) / top, 0, 1)
    ks = 1.5 * least - 0.5
    t = (e1 - ks) / (1 - ks)
    p = (2 * t**3 - 3 * t**2 + 1) * ks + (t**3 - 2 * t**2 + t) * (1 - ks) + (-2 * t**3 + 3 * t**2) * least
    e2 = np.where(e1 < ks, e1, p) * top
    low, high = np.zeros_like(light), np.full_like(light, 1.01)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (
            np.where(pq(203 * middle) < e2, middle, low),
            np.where(pq(203 * middle) < e2, high, middle),
        )
    return low


def srgb(light: Array) -> Array:
    light = np.clip(light, 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def test_the_curve_is_the_reports() -> None:
    light = np.linspace(0, 7, 3001)
    np.testing.assert_allclose(tone_mapped(light), bt2390(light), atol=1e-6)
    assert (np.diff(tone_mapped(light)) >= 0).all()
    assert tone_mapped(np.array(1000 / 203)) == pytest.approx(1)


def written(work: Path, out: Path, suffix: str) -> Array:
    assert run("render", work, *BRIGHT, "--grain", 0, "--frames", SHOWN, "--out", out / f"####{suffix}") == 0
    return read_picture(out / f"{SHOWN:04d}{suffix}")[..., :3].astype(float)


@pytest.mark.parametrize("space", [HLG, PQ], ids=lambda space: space.name)
def test_pictures_are_mapped_and_light_is_kept(registered: None, tmp_path: Path, space: Recorded) -> None:
    """Each pixel of the PNG is the curve of the EXR's, and hardly any is pure white."""
    bright = [np.minimum(6 * light, 4.5) for light in filmed(tmp_path / "plane")]
    write_clip(tmp_path / "clip.mov", bright, space)
    work = imported(tmp_path, tmp_path / "clip.mov")
    light = written(work, tmp_path / "exr", ".exr")
    shown = written(work, tmp_path / "png", ".png") / 257
    assert light.max() > 2
    assert (light.max(axis=2) > 1).mean() > 0.2
    np.testing.assert_allclose(shown, srgb(bt2390(np.maximum(light, 0))), atol=1.5)
    is_below = light.max(axis=2) < 1000 / 203
    assert (shown[is_below].min(axis=1) >= 254.5).mean() < 0.02


def test_a_usual_clip_has_no_curve(registered: None, tmp_path: Path) -> None:
    ordinary = Recorded("sRGB", lambda light: srgb(light) / 255, ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06)), 1)
    write_clip(tmp_path / "clip.mov", filmed(tmp_path / "plane"), ordinary)
    work = imported(tmp_path, tmp_path / "clip.mov")
    light = written(work, tmp_path / "exr", ".exr")
    shown = written(work, tmp_path / "png", ".png") / 257
    np.testing.assert_allclose(shown, srgb(light), atol=0.6)
    assert not bpy.context.scene.view_settings.use_curve_mapping


def saved(folder: Path) -> Path:
    write_clip(folder / "clip.mov", [3 * light for light in filmed(folder / "plane")], HLG)
    blend = folder / "a.blend"
    assert run("save", imported(folder, folder / "clip.mov"), *BRIGHT, "--blend", blend) == 0
    return blend


def test_the_users_view_stays_and_what_it_loses_is_noted(registered: None, tmp_path: Path) -> None:
    """F12 in a .blend: with our curve nothing is lost; without it a note names the share, in PNG alone."""
    bpy.ops.wm.open_mainfile(filepath=str(saved(tmp_path)))
    scene = bpy.context.scene
    view, form = scene.view_settings, scene.render.image_settings
    assert hdr_view.has_curve(view)
    scene.frame_set(SHOWN)

    def notes() -> tuple[list[str], Array]:
        before = view.view_transform, view.use_curve_mapping
        with engine.watched() as watch:
            watch.pictures = {}
            bpy.ops.render.render(scene=scene.name)
        assert (view.view_transform, view.use_curve_mapping) == before
        lost = [note for note in watch.notes if "brighter than white" in note]
        return lost, watch.pictures["Combined"].astype(float)

    form.file_format = "PNG"
    assert notes()[0] == []
    view.use_curve_mapping = False
    said, light = notes()
    share = np.mean(light[..., :3].max(axis=2) > 1)
    assert share > 0.1
    assert said == [f"{share:.0%} of the pixels are brighter than white and lost in this format:"
                    f" {hdr_view.WAYS_OUT}"]  # fmt: skip
    view.view_transform = "AgX"
    assert notes()[0] == []
    view.view_transform, form.file_format = "Standard", "OPEN_EXR"
    assert notes()[0] == []


def test_the_curve_follows_the_color_space_and_leaves_the_users(registered: None, tmp_path: Path) -> None:
    scene, settings, _ = open_blend(saved(tmp_path))
    view = scene.view_settings
    assert hdr_view.has_curve(view)
    settings.colour_space = "sRGB"
    assert not view.use_curve_mapping
    own = view.curve_mapping.curves[0]
    settings.colour_space = "Rec.2100-PQ"
    assert hdr_view.has_curve(view)
    own.points[5].location = 0.2, 0.7
    assert not hdr_view.has_curve(view)
    settings.colour_space = ""
    assert view.use_curve_mapping
    assert own.points[5].location[1] == pytest.approx(0.7)
