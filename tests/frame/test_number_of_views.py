"""The number of views, by the blur, and what few prefiltered ones are worth."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import encode_srgb, to_linear
from addon.core.optics.aperture_sampling import views_needed
from addon.render.views.average import draw_mean
from addon.render.views.gpu_views import gpu_problem
from benchmarks.timings.view_error import plain

from ..scenes import psnr, slanted_plane, texture

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
SIZE = (160, 90)
SOURCE = to_linear(texture(*SIZE))
needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="hundreds of views need a GPU context")


class Step:
    """A near half before a far one, with a strip in focus."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        column = np.arange(SIZE[0])
        inverse = np.select([column < 50, column < 90], [1 / 4, 1 / 6], 1 / 16)
        return PixelDepth(np.tile(inverse, (SIZE[1], 1)))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def meshed(method: str = "layers", radius: float = 0.5) -> Frame:
    clip = ClipContext(slanted_plane(LENS, near=4.0, far=16.0), lambda frame: texture(*SIZE), Step())
    options = FrameOptions(Focus(distance=6.0), radius, method=method, borrow=False)
    return mesh_frame(clip, 2, options, SIZE, SOURCE)


def shown(frame: Frame) -> Floats:
    """(H, W, 3) as displayed, without the border."""
    return displayed(draw_mean(frame))


def displayed(mean: LinearRGBA) -> Floats:
    return np.asarray(encode_srgb(np.clip(mean[8:-8, 8:-8, :3].astype(np.float64), 0, 1)))


@cache
def reference() -> Floats:
    return shown(plain(meshed(), 256))


@needs_gpu
def test_few_prefiltered_views_look_like_many() -> None:
    frame, true = meshed(), reference()
    for count in (4, 8, 16, 64):
        few = psnr(shown(plain(frame, count)), true)
        prefiltered = psnr(shown(frame.through(count)), true)
        print(f"{count} views: {few:.1f} dB, prefiltered {prefiltered:.1f} dB")
        assert prefiltered > few
        assert count != 16 or prefiltered > few + 6


def test_more_blur_takes_more_views() -> None:
    for blur in (0, 4, 16, 32, 64, 1000):
        assert views_needed(blur, True) <= views_needed(blur, False)
        assert views_needed(blur, True) <= views_needed(blur + 8, True)
