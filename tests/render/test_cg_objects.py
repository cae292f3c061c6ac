"""CG objects in the clip: Cycles draws them, and our views blur them with it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base.worker import Worker
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.render.cg import cg_preview, cg_process
from addon.render.cg.cycles_layers import CyclesScene, Wanted
from addon.scene.base.exr import read
from addon.scene.build import build
from addon.scene.sources.shot import shot_of

from ..in_blender import LIGHT, place_lamp
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
DISTANCE = 8.0


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius = DISTANCE, 0.2
    settings.method, settings.views = "features", 16
    scene.cycles.samples, scene.cycles.use_denoising = 8, False
    scene.frame_set(2)
    return scene


def test_it_is_in_the_picture_with_the_blur_of_its_distance(solved: bpy.types.Scene, tmp_path: Path) -> None:
    plain = rendered(solved, tmp_path / "plain.exr")
    # Half as far as what is in focus: its disc is 2 R f (1 / 4 - 1 / 8) = 7 pixels across, its side 20.
    place_lamp(solved, 4.0, 20)
    # Behind the clip's plane, which is 12 away at its farthest: it is not seen.
    place_lamp(solved, 30.0, 40)
    # Each frame of the file is drawn by one process.
    with cg_process.kept():
        both = rendered(solved, tmp_path / "both.exr")
        again = rendered(solved, tmp_path / "again.exr")
    assert np.array_equal(both, again)
    assert np.allclose(both[42:48, 77:83, :3], LIGHT, rtol=0.02)
    assert np.allclose(both[:, :40], plain[:, :40], atol=1e-4)
    # What it hides of the clip is black where it covers all of a pixel, and its light is spread, not lost.
    share = (both - plain)[..., 0].sum() / (LIGHT - plain[35:55, 70:90, 0].mean())
    assert share == pytest.approx(20 * 20, rel=0.02)
    row = (both - plain)[45, 60:80, 0]
    soft = np.count_nonzero((row > 0.03 * LIGHT) & (row < 0.97 * LIGHT))
    assert 5 <= soft <= 9


def test_the_lens_distorts_it_as_it_does_the_clip(scene: bpy.types.Scene, tmp_path: Path) -> None:
    bent = replace(LENS, k1=-0.2)
    shot = slanted_shot(tmp_path / "clip", bent)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius = DISTANCE, 0.001
    settings.method, settings.views = "features", 4
    scene.cycles.samples = 16
    scene.frame_set(2)
    places = [(-0.5, 0.0), (0.45, -0.25), (-0.5, 0.28), (0.2, 0.2), (0.0, 0.0)]
    for across, down in places:
        place_lamp(scene, 3.0, 6, across, down)
    seen = rendered(scene, tmp_path / "bent.exr")
    for across, down in places:
        ray = np.array([across, down, 1.0])
        expected = bent.project(ray)
        column, row = (int(each) for each in expected)
        # Less than the clip's white, light is the lamp's.
        part = np.clip(seen[row - 6 : row + 7, column - 6 : column + 7, 0] - 1, 0, None)
        found = [(part.sum(axis=axis) * np.arange(13)).sum() / part.sum() for axis in (0, 1)]
        assert found[0] + column - 5.5 == pytest.approx(expected[0], abs=0.3), (across, down)
        assert found[1] + row - 5.5 == pytest.approx(expected[1], abs=0.3), (across, down)
    assert (
        np.linalg.norm(bent.project(np.array([-0.5, 0.28, 1])) - LENS.project(np.array([-0.5, 0.28, 1]))) > 4
    )


def test_its_shadow_falls_on_the_clip_where_the_sun_puts_it(solved: bpy.types.Scene, tmp_path: Path) -> None:
    cycles_scene = CyclesScene(solved, tmp_path, is_preview=False)
    to_world = solved.camera.matrix_world.normalized()
    place_lamp(solved, 4.0, 20).data.materials.clear()
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    # It shines along the camera's axis, from behind it.
    sun.data.angle, sun.matrix_world = 0.0, to_world
    solved.collection.objects.link(sun)
    # What the square's back throws into its shadow is noise with so few samples.
    solved.world, solved.cycles.max_bounces = None, 0
    wall = np.full((LENS.height, LENS.width), 1 / DISTANCE, np.float32)
    drawn = cycles_scene.draw(Wanted(solved.view_layers[0].name, 2, LENS, 6, wall))
    (layer,) = drawn.layers
    assert layer.inverse_depth == pytest.approx(1 / 4.0, rel=1e-4)
    assert layer.corner == pytest.approx((70, 35), abs=1) and drawn.shadow is not None
    # As wide as the square, at twice its distance: 10 pixels.
    assert np.allclose(drawn.shadow[41:49, 76:84], 0, atol=0.02)
    outside = np.ones((LENS.height, LENS.width), bool)
    outside[39:51, 74:86] = False
    assert np.allclose(drawn.shadow[outside], 1, atol=0.02)
    # Drawn again it is there still, and without light there is no shadow.
    sun.hide_render = True
    drawn = cycles_scene.draw(Wanted(solved.view_layers[0].name, 2, LENS, 6, wall))
    assert len(drawn.layers) == 1 and drawn.shadow is None


def test_what_lies_apart_in_depth_is_drawn_whole(solved: bpy.types.Scene, tmp_path: Path) -> None:
    cycles_scene = CyclesScene(solved, tmp_path, is_preview=False)
    for distance, side in ((4.0, 10), (6.0, 30), (6.001, 5)):
        place_lamp(solved, distance, side)
    nothing = np.zeros((0, 0), np.float32)
    drawn = cycles_scene.draw(Wanted(solved.view_layers[0].name, 2, LENS, 0, nothing))
    # Near ones first; what is a thousandth apart may touch, and what is hidden there stays hidden.
    assert [layer.picture[..., 3].sum() for layer in drawn.layers] == pytest.approx([100, 900], rel=0.03)
    depths = [np.median(layer.inverse_depth) for layer in drawn.layers]
    assert depths == pytest.approx([1 / 4, 1 / 6], rel=1e-3)


def test_what_cycles_cannot_do_is_said(solved: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    place_lamp(solved, 4.0, 20)

    def ended(worker: Worker, *more: object, **named: object) -> None:
        worker.start([sys.executable, "-c", "raise SystemExit('no')"])

    monkeypatch.setattr(cg_process, "start", ended)
    with pytest.raises(RuntimeError, match="the CG objects of frame 2 could not be rendered"):
        bpy.ops.render.render(scene=solved.name)


def rendered(scene: bpy.types.Scene, file: Path) -> np.ndarray:
    """(H, W, 4) linear light."""
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read(file)


def test_what_moves_is_blurred_by_the_shutter_at_its_own_depth(
    solved: bpy.types.Scene, tmp_path: Path
) -> None:
    cycles_scene = CyclesScene(solved, tmp_path, is_preview=False)
    lamp = place_lamp(solved, 4.0, 20)
    step = 40 / LENS.fx * 4.0
    for frame in (1, 2, 3):
        lamp.location = (frame - 2) * step * solved.camera.matrix_world.normalized().col[0].xyz
        lamp.keyframe_insert("location", frame=frame)
    for curve in lamp.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    # The camera stands.
    solved.camera.animation_data_clear()
    solved.cycles.samples = 256
    solved.render.use_motion_blur, solved.render.motion_blur_shutter = True, 0.5
    nothing = np.zeros((0, 0), np.float32)
    drawn = cycles_scene.draw(Wanted(solved.view_layers[0].name, 2, LENS, 0, nothing))
    (layer,) = drawn.layers
    alpha = layer.on_raster((0, 0), (LENS.height, LENS.width)).picture[45, :, 3]
    # A square of 20 pixels that goes 20 pixels: it covers the middle for all of the time but a moment.
    row = np.arange(LENS.width) + 0.5 - 80
    assert np.allclose(alpha, np.clip(1 - np.abs(row) / 20, 0, 1), atol=0.08)
    assert np.allclose(layer.inverse_depth, 1 / 4, rtol=1e-3)


def test_the_preview_draws_what_a_render_draws(solved: bpy.types.Scene) -> None:
    """Also an object that a solve hid, once it is shown again: nothing of the object itself has changed."""
    layer = solved.view_layers[0]
    near, far = place_lamp(solved, 4.0, 20), place_lamp(solved, 8.0, 20)
    solved.virtual_aperture.hidden.add().thing = far
    far.hide_set(True)
    canvas = Canvas(shot_of(solved).reconstruction.intrinsics(shot_of(solved).reconstruction.images[1]))
    counts = []
    try:
        for _ in range(2):
            wanted = cg_preview.wanted(solved, layer)
            assert wanted is not None
            with cg_process.kept():
                draws = (
                    cg_preview.draw_preview(wanted, cg_preview.file_of(wanted)),
                    cg_process.draw_cg(solved, layer.name),
                )
                counts.append([len(draw(2, canvas, None).layers) for draw in draws if draw is not None])
            far.hide_set(False)
    finally:
        cg_preview._drawing.end()
        cg_preview.forget()
    assert near.visible_get() and counts == [[1, 1], [2, 2]]
