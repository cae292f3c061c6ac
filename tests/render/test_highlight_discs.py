"""Highlights drawn as discs against many views of the same layers: what hides them, in either order of
depth."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGB, LinearRGBA, Mask
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import RESTORED, HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import encode_srgb
from addon.core.warp.layered_mesh import FINER
from addon.render.views.average import draw_mean
from addon.render.views.gpu_views import gpu_problem

from ..scenes import psnr, slanted_plane, texture

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
SIZE = (240, 160)
LENS = Intrinsics(*SIZE, 200.0, 200.0, 120.0, 80.0)
FAR = 8.0
DISC = 24
"""Pixels of the highlights' discs."""


class Step:
    """A depth source: a disc and a bar before a wall at FAR."""

    def __init__(self, near: float) -> None:
        row, column = np.mgrid[: SIZE[1], : SIZE[0]]
        self.near = (np.hypot(row - 80, column - 90) < 30) | ((column > 170) & (column < 182))
        self._inverse: Floats = np.where(self.near, 1 / near, 1 / FAR)

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        return PixelDepth(self._inverse)

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def highlights() -> LinearRGB:
    """(H, W, 3) linear light of some, a part of whose discs what is before the wall hides. They are as smooth
    as a texture that is interpolated can show."""
    light = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    for y, x in ((80, 128), (40, 90), (110, 118), (30, 30), (60, 161), (100, 190), (130, 158), (80, 50)):
        light[y : y + 2, x : x + 2] = 40.0
    return np.asarray(cv2.GaussianBlur(light, (0, 0), 1.0), np.float32)


def source(near: Mask) -> LinearRGBA:
    """(H, W, 4) linear: a grey wall with highlights, and what is before it."""
    picture = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    picture[..., :3] = np.where(near[..., None], 0.2, 0.05 + highlights())
    return picture


def meshed(near: float, focus: float, highlights: HighlightSettings = RESTORED) -> Frame:
    step = Step(near)
    radius = DISC / (2 * LENS.fx * abs(1 / FAR - 1 / focus))
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), step)
    lens = FrameOptions(Focus(distance=focus), radius, borrow=False, highlights=highlights)
    return mesh_frame(clip, 2, lens, SIZE, source(step.near))


def on_the_wall(warped: Frame) -> Frame:
    """The frame with its highlights on the farthest surface of its texture: whole behind what is before it,
    and none made up there."""
    *fronts, last = warped.layers
    height, width = last.disparity.shape
    light = np.where(Step(1.0).near[..., None], 0, highlights())
    row, column = (height - SIZE[1]) // 2, (width - SIZE[0]) // 2
    wide = cv2.copyMakeBorder(light, row, row, column, column, cv2.BORDER_CONSTANT)
    # A texel in two is a pixel, what is between them is linear.
    finer = np.diag([1 / FINER, 1 / FINER, 1])[:2]
    size = FINER * width, FINER * height
    picture = last.picture.copy()
    picture[..., :3] += cv2.warpAffine(wide, finer, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    return replace(warped, layers=(*fronts, replace(last, picture=picture)), highlight_discs=None)


@needs_gpu
@pytest.mark.parametrize(
    ("near", "focus", "least"), [
        (4.0, 4.0, 50.0), (5.0, 4.0, 48.0), pytest.param(3.0, 4.0, 45.0, marks=pytest.mark.long),
        pytest.param(4.0, 16.0, 40.0, marks=pytest.mark.long),
    ],
    ids=["in focus", "between", "before the focal plane", "all before it"],
)  # fmt: skip
def test_highlights_are_hidden_as_many_views_hide_them(near: float, focus: float, least: float) -> None:
    frame = meshed(near, focus)
    # All else alike: the same views of the same texture, without highlights and with them.
    few = frame.through(16)
    dark = replace(few, highlight_discs=None)
    many = frame.through(1024, prefiltered=False)
    lit = draw_mean(on_the_wall(many)) - draw_mean(replace(many, highlight_discs=None))
    ours = draw_mean(few) - draw_mean(dark)
    found = psnr(*(encode_srgb(np.clip(part[..., :3].astype(np.float64), 0, 1)) for part in (ours, lit)))
    print(f"{found:.1f} dB, energy {ours[..., 1].sum() / lit[..., 1].sum():.4f}")
    assert found > least
    assert ours[..., 1].sum() == pytest.approx(lit[..., 1].sum(), rel=1e-2)
