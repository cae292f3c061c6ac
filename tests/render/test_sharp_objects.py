"""CG objects that stay sharp, against the closed form: a title before and between blurred surfaces."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.arrays import LinearRGB, LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.cg_layers import CGObjects
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import draw_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import encode_srgb
from addon.core.warp.cg_layer import CGLayer
from addon.render.views import average
from addon.render.views.gpu_views import gpu_problem
from addon.scene.build import build
from addon.scene.cg_objects import STAYS_SHARP
from benchmarks.accuracy.scatter import disc_kernel

from ..in_blender import LIGHT, place_lamp
from ..scenes import psnr, slanted_plane, slanted_shot

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
SIZE = (192, 108)
LENS = Intrinsics(*SIZE, 180.0, 180.0, 96.0, 54.0)
NEAR, FAR = 4.0, 8.0
DISC = 24
"""Pixels of the disc of the ball, where the wall is in focus."""
BALL, WALL, TITLE = (0.8, 0.5, 0.1), (0.1, 0.2, 0.5), (0.9, 0.9, 0.9)
Y, X = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5


def ball() -> Map:
    """(H, W) share of pixels that the ball covers."""
    return np.clip(30.5 - np.hypot(X - 96, Y - 54), 0, 1).astype(np.float32)


def title() -> Map:
    """(H, W) alpha of a title: bars of 3 pixels, half of a ball's width."""
    return ((X // 3 % 2 == 0) & (np.abs(Y - 54) < 20) & (X > 66) & (X < 156)).astype(np.float32)


def over(alpha: Map, colour: tuple[float, ...], below: LinearRGB) -> LinearRGB:
    return np.asarray(alpha[..., None] * np.array(colour) + (1 - alpha[..., None]) * below, np.float32)


class Depth:
    """A depth source: a round thing before a wall."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        inverse = np.where(ball() > 0.5, 1 / NEAR, 1 / FAR).astype(np.float32)
        return PixelDepth(inverse, np.ones(SIZE[::-1], np.float32), np.zeros(SIZE[::-1], bool))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


@needs_gpu
@pytest.mark.parametrize("is_sharp", [True, False])
@pytest.mark.parametrize("distance", [3.0, 6.0], ids=["before", "between"])
def test_a_title_is_sharp_wherever_it_stands(distance: float, is_sharp: bool) -> None:
    wall = np.broadcast_to(np.array(WALL, np.float32), (*SIZE[::-1], 3))
    seen = np.rint(255 * encode_srgb(over(ball(), BALL, wall))).astype(np.uint8)
    clip = ClipContext(slanted_plane(LENS), lambda frame: seen, Depth())
    radius = DISC / (2 * LENS.fx * (1 / NEAR - 1 / FAR))
    lens = FrameOptions(Focus(distance=FAR), radius, borrow=False, grain=0.0)
    picture = np.concatenate([over(title(), TITLE, np.zeros_like(wall)), title()[..., None]], axis=2)
    layer = CGLayer.of(picture, np.full(SIZE[::-1], 1 / distance, np.float32), 0, 0.0, is_sharp)
    assert layer is not None
    cg = CGObjects((layer,))
    found, _ = draw_frame(clip, 2, lens, SIZE, average._views, lambda *_: cg)
    blurred = cv2.filter2D(ball(), -1, disc_kernel(DISC))
    true = over(title(), TITLE, over(blurred, BALL, wall))
    if distance > NEAR:
        true = over(blurred, BALL, over(title(), TITLE, wall))
    score = psnr(encode_srgb(np.clip(found[..., :3], 0, 1)), encode_srgb(true))
    print(f"a title {distance:g} away, sharp {is_sharp}: {score:.1f} dB")
    assert score >= 45 if is_sharp else score < 30


@needs_gpu
def test_an_object_stays_sharp_by_its_switch(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0))
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius, settings.grain = 8.0, 0.2, 0.0
    settings.method, settings.views = "features", 16
    scene.cycles.samples, scene.cycles.use_denoising = 8, False
    scene.frame_set(2)
    plain = rendered(scene, tmp_path / "plain.exr")
    setattr(place_lamp(scene, 4.0, 20), STAYS_SHARP, True)
    row = (rendered(scene, tmp_path / "sharp.exr") - plain)[45, 60:80, 0]
    soft = np.count_nonzero((row > 0.03 * LIGHT) & (row < 0.97 * (LIGHT - plain[45, 60:80, 0])))
    assert soft <= 2


def rendered(scene: bpy.types.Scene, file: Path) -> np.ndarray:
    """(H, W, 4) as it is in a file."""
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(file))
    width, height = image.size
    return np.array(image.pixels).reshape(height, width, 4)[::-1]
