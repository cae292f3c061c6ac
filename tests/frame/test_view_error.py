"""The number of views: by the blur, and by a wished error."""

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
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.view_error import FIRST, PILOT, difference, other_views, views_for_error, views_to_error
from addon.core.frame.warped_frame import MeshedFrame, WarpedFrame
from addon.core.media.light import encode_srgb, to_linear
from addon.core.optics.aperture_sampling import MAX_VIEWS, views_needed
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


def meshed(method: str = "layers", radius: float = 0.5) -> MeshedFrame:
    clip = ClipContext(slanted_plane(LENS, near=4.0, far=16.0), lambda frame: texture(*SIZE), Step())
    options = FrameOptions(Focus(distance=6.0), radius, method=method, borrow=False)
    return mesh_frame(clip, 2, options, SIZE, SOURCE)


def shown(warped: WarpedFrame) -> Floats:
    """(H, W, 3) as displayed, without the border."""
    return displayed(draw_mean(warped))


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


@needs_gpu
@pytest.mark.parametrize("wished", [32.0, 38.0, 44.0])
def test_a_wished_error_is_met(wished: float) -> None:
    warped, mean = views_to_error(meshed(), wished, draw_mean)
    found = psnr(displayed(mean), reference())
    print(f"{wished} dB wished, {found:.1f} dB with {len(warped.plan.offsets)} views")
    assert found > wished - 1
    assert len(warped.plan.offsets) == len(warped.plan.registration)


@needs_gpu
def test_less_blur_takes_fewer_views() -> None:
    counts = [len(views_to_error(meshed(radius=r), 50.0, draw_mean)[0].plan.offsets) for r in (0.1, 0.8)]
    assert counts[0] < counts[1]


@needs_gpu
def test_other_methods_have_a_wished_error_too() -> None:
    frame = meshed("features")
    many = shown(frame.through(256))
    _, mean = views_to_error(frame, 36.0, draw_mean)
    assert psnr(displayed(mean), many) > 35


def test_a_frame_is_made_again_for_another_number() -> None:
    frame = meshed()
    texture = frame.surface.texture.copy()
    first, second = frame.through(8), frame.through(24)
    np.testing.assert_array_equal(frame.surface.texture, texture)
    assert (len(first.plan.offsets), len(second.plan.offsets)) == (8, 24)
    assert not np.array_equal(first.texture, second.texture)
    again = frame.through(8, reuse=True)
    assert again.texture is frame.surface.texture
    np.testing.assert_array_equal(again.texture, first.texture)


def test_the_second_set_is_another_one_as_far_out() -> None:
    frame = meshed()
    first = frame.through(PILOT)
    second = other_views(frame, first)
    length = [np.linalg.norm(one.plan.offsets, axis=1) for one in (first, second)]
    np.testing.assert_allclose(length[0], length[1], atol=1e-12)
    apart = np.linalg.norm(first.plan.offsets[:, None] - second.plan.offsets, axis=2)
    assert apart.min() > 0.5 * length[0].max()


def test_differences_are_told_in_decibels() -> None:
    one = np.full((4, 5, 4), 0.5, np.float32)
    assert difference(one, one) == np.inf
    other = one.copy()
    other[..., :3] = 0.6
    step = encode_srgb(np.array([0.6])) - encode_srgb(np.array([0.5]))
    assert difference(one, other) == pytest.approx(-20 * np.log10(float(step[0])), abs=1e-3)
    # What is white is not told apart.
    assert difference(3 * one, 4 * one) == np.inf


def test_a_better_wish_takes_more_views() -> None:
    for prefiltered in (True, False):
        counts = [views_for_error(36.0, wished, prefiltered) for wished in (30, 38, 44, 50, 60, 200)]
        assert counts[0] == 0 and counts == sorted(counts) and counts[-1] == MAX_VIEWS
        assert views_for_error(np.inf, 80.0, prefiltered) == 0
    assert views_for_error(36.0, 38.0, True) == FIRST
    for blur in (0, 4, 16, 32, 64, 1000):
        assert views_needed(blur, True) <= views_needed(blur, False)
        assert views_needed(blur, True) <= views_needed(blur + 8, True)
