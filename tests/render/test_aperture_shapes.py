"""What shapes of the aperture do to pictures, against convolution: a plane out of focus is blurred by the
aperture's own shape."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import LinearRGBA, Map
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
from addon.core.optics.aperture import Aperture, ApertureImage
from addon.core.optics.aperture_sampling import exact_registration
from addon.render.views.average import draw_mean
from addon.render.views.gpu_views import gpu_problem

from ..scenes import psnr, slanted_plane, texture
from ..variants import combined

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
SIZE = (192, 108)
BY_VIEWS = HighlightSettings(gain=0)
"""Lamps stay in the texture."""
LENS = Intrinsics(*SIZE, 180.0, 180.0, 96.0, 54.0)
SIDE = 25
"""Pixels of the blur disc, and of the kernel that stands for it."""
NEAR, FAR = 4.0, 8.0


def letter() -> ApertureImage:
    """An F, which is another one upside down and mirrored."""
    light = np.zeros((75, 75), np.uint8)
    cv2.putText(light, "F", (12, 68), cv2.FONT_HERSHEY_SIMPLEX, 2.6, 255, 12)
    return ApertureImage(light.astype(np.float32) / 255)


SHAPES = {
    "disc": Aperture(),
    "pentagon": Aperture(blades=5, rotation=0.3),
    "round hexagon": Aperture(blades=6, roundness=0.5),
    "anamorphic": Aperture(ratio=1.8),
    "mirror": Aperture(obstruction=0.45),
    "apodised": Aperture(apodisation=0.9),
    "soap bubble": Aperture(spherical_aberration=0.8),
    "picture": Aperture(image=letter()),
}


class Plane:
    """A depth source: everything is equally far."""

    def __init__(self, distance: float) -> None:
        self._inverse = np.full(SIZE[::-1], 1 / distance, np.float32)

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        shape = picture.shape[:2]
        return PixelDepth(self._inverse, np.ones(shape, np.float32), np.zeros(shape, bool))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


class Step(Plane):
    """The right half is as far as NEAR, the left one as FAR."""

    def __init__(self) -> None:
        inverse = np.full(SIZE[::-1], 1 / FAR, np.float32)
        inverse[:, SIZE[0] // 2 :] = 1 / NEAR
        self._inverse = inverse


def source() -> LinearRGBA:
    """(h, w, 4) linear: a texture, and lamps that show the aperture's shape."""
    picture = 0.3 * (texture(*SIZE).astype(np.float32) / 255) ** 2.2
    picture[30:90:30, 40:170:30] += 150.0
    picture = cv2.GaussianBlur(picture, (0, 0), 1.2)
    return np.dstack([picture, np.ones(SIZE[::-1], np.float32)])


def meshed(
    shape: Aperture,
    distance: float,
    focus: float,
    highlights: HighlightSettings = RESTORED,
    picture: LinearRGBA | None = None,
) -> Frame:
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Plane(distance))
    radius = SIDE / (2 * LENS.fx * abs(1 / distance - 1 / focus))
    lens = FrameOptions(Focus(distance=focus), radius, borrow=False, aperture=shape, highlights=highlights)
    return mesh_frame(clip, 2, lens, SIZE, source() if picture is None else picture)


def convolved(shape: Aperture, is_behind: bool) -> LinearRGBA:
    """The source blurred by the aperture's shape, upright behind the focal plane."""
    kernel = shape.raster(SIDE)[0]
    kernel /= kernel.sum()
    # OpenCV correlates: for it the kernel is turned round.
    return cv2.filter2D(source(), -1, kernel[::-1, ::-1] if is_behind else kernel)


def error(mean: Map, true: Map) -> float:
    """PSNR in dB as displayed, away from the border."""
    inner = (slice(SIDE, -SIDE), slice(SIDE, -SIDE), slice(3))
    return psnr(*(encode_srgb(np.clip(part[inner].astype(np.float64), 0, 1)) for part in (mean, true)))


@needs_gpu
@pytest.mark.parametrize(("shape", "is_behind"), combined(SHAPES, {"behind": True, "before": False}))
def test_a_plane_out_of_focus_is_convolved_with_the_shape(shape: Aperture, is_behind: bool) -> None:
    frame = meshed(shape, *((FAR, NEAR) if is_behind else (NEAR, FAR)), BY_VIEWS)
    true = convolved(shape, is_behind)
    for count, least in ((24, 32.0), (96, 45.0), (256, 50.0)):
        mean = draw_mean(frame.through(count))
        found = error(mean, true)
        energy = mean[SIDE:-SIDE, SIDE:-SIDE, :3].mean() / true[SIDE:-SIDE, SIDE:-SIDE, :3].mean()
        print(f"{count} views: {found:.1f} dB, energy {energy:.4f}")
        assert found > least
        assert energy == pytest.approx(1, abs=2e-3 if count < 96 else 1e-3)


@needs_gpu
@pytest.mark.parametrize(("shape", "is_behind"), combined(SHAPES, {"behind": True, "before": False}))
def test_few_views_draw_lamps_as_the_shape(shape: Aperture, is_behind: bool) -> None:
    mean = draw_mean(meshed(shape, *((FAR, NEAR) if is_behind else (NEAR, FAR))).through(12))
    true = convolved(shape, is_behind)
    assert error(mean, true) > 50
    energy = mean[SIDE:-SIDE, SIDE:-SIDE, :3].mean() / true[SIDE:-SIDE, SIDE:-SIDE, :3].mean()
    assert energy == pytest.approx(1, abs=1e-3)


@needs_gpu
def test_vignetting_makes_cats_eyes_in_the_corners_alone_and_keeps_what_is_in_focus() -> None:
    shape = Aperture(vignetting=0.7)
    cut = draw_mean(meshed(shape, FAR, NEAR, BY_VIEWS).through(96))
    lamps = [cut[46:74, x - 14 : x + 14, 1] for x in (100, 160)]
    middle, corner = ((lamp > 0.5 * np.percentile(lamp, 80)).sum() for lamp in lamps)
    whole = np.pi / 4 * SIDE**2
    assert 0.85 * whole < middle < 1.1 * whole
    # The overlap of two discs whose middles are so far apart, in radii.
    apart = 0.7 * np.hypot(160 - 96, 60 - 54) / np.hypot(96, 54)
    overlap = (2 * np.arccos(apart / 2) - apart / 2 * np.sqrt(4 - apart**2)) / np.pi
    assert corner == pytest.approx(overlap * middle, rel=0.08)
    sharp = FrameOptions(Focus(distance=FAR), 0.5, borrow=False, aperture=shape)
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Plane(FAR))
    mean = draw_mean(mesh_frame(clip, 2, sharp, SIZE, source()).through(24))
    np.testing.assert_allclose(mean[..., :3], source()[..., :3], atol=4e-3)


@needs_gpu
@pytest.mark.parametrize("focus", [NEAR, FAR, 6.0], ids=["near", "far", "between"])
def test_red_and_blue_are_as_a_lens_focused_farther_away_draws_them(focus: float) -> None:
    axial, shape = 0.2, Aperture(axial_colour=0.2)
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Step())
    settings = FrameOptions(Focus(distance=focus), 0.5, borrow=False, aperture=shape, highlights=BY_VIEWS)
    warped = mesh_frame(clip, 2, settings, SIZE, source()).through(48)
    plan = replace(warped.views, axial_colour=0.0)
    farther = (1 - axial) * plan.lens.focus
    apart = replace(
        plan, lens=replace(plan.lens, focus=farther),
        registration=exact_registration(plan.canvas, plan.offsets, farther),
    )  # fmt: skip
    mean, green, others = (draw_mean(replace(warped, views=each)) for each in (warped.views, plan, apart))
    np.testing.assert_array_equal(mean[..., [1, 3]], green[..., [1, 3]])
    red_and_blue = [0, 2, 2]
    print(f"{error(mean[..., red_and_blue], others[..., red_and_blue]):.1f} dB")
    assert error(mean[..., red_and_blue], others[..., red_and_blue]) > 45
    assert error(green[..., red_and_blue], others[..., red_and_blue]) < 30
