"""Aberrations of the lens, against rays that are traced one place of the aperture at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import RESTORED, HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import DRAFT, NORMAL, Quality
from addon.core.media.light import encode_srgb
from addon.core.media.picture_file import read_picture
from addon.core.optics.aberrations import Aberrations
from addon.core.optics.aperture import Aperture
from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.optics.breathing import LEAST_ENLARGED, MOST_ENLARGED, enlargement
from addon.render.viewport.pictures import FINE, Wanted, make_picture
from addon.render.views.average import draw_mean, render_frame
from addon.render.views.gpu_views import bend_rows, gpu_problem
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.lens.lens import frame_options
from addon.scene.sources.shot import shot_of

from ..scenes import psnr, slanted_plane, slanted_shot, texture
from ..variants import variants

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
SIZE = (240, 136)
LENS = Intrinsics(*SIZE, 210.0, 210.0, 120.0, 68.0)
HALF = float(np.hypot(*SIZE) / 2)
BY_VIEWS = HighlightSettings(gain=0)
"""Lamps stay in the texture."""
NEAR, FOCUS, FAR, RADIUS = 4.0, 5.5, 8.0, 0.3
TRACED, LAMPS_TRACED = 256, 1024
"""Rays to a pixel: of a lamp as wide as two pixels, its copies must not show."""

Shift = Callable[[Floats, Floats, Floats, Floats], tuple[Floats, Floats]]
"""Where a ray from (px, py) in aperture radii is shifted at (hx, hy) in half-diagonals, in shares of the blur
at infinity."""
Passes = Callable[[Floats, Floats, Floats, Floats], Floats]
"""The share of the ray's light that passes."""


def radial(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Radius, unit vector away from the middle, and the place's part along it."""
    far = np.hypot(hx, hy) + 1e-12
    return far, hx / far, hy / far, (px * hx + py * hy) / far


def swirl(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    """The part of the ray across the radius is defocused."""
    far, x, y, along = radial(px, py, hx, hy)
    return 0.5 * far**2 * (px - along * x), 0.5 * far**2 * (py - along * y)


def coma(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    """A zone of the aperture makes a circle, as many times round as the zone, away from the point."""
    far, x, y, _ = radial(px, py, hx, hy)
    zone, angle = px**2 + py**2, 2 * (np.arctan2(py, px) - np.arctan2(y, x))
    out, side = 2 + np.cos(angle), np.sin(angle)
    size = 0.4 / 3 * far * zone
    return size * (out * x - side * y), size * (out * y + side * x)


def curved(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    return 0.5 * (hx**2 + hy**2) * px, 0.5 * (hx**2 + hy**2) * py


def sideways(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    return 0.3 * px, 0.0 * py


def straight(px: Floats, py: Floats, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    return 0.0 * px, 0.0 * py


def whole(px: Floats, py: Floats, hx: Floats, hy: Floats) -> Floats:
    return np.ones_like(hx)


def boxed(px: Floats, py: Floats, hx: Floats, hy: Floats) -> Floats:
    """Nothing passes the edges of a square around the aperture, which is seen from the side at the border."""
    across, down = hx * HALF / (SIZE[0] / 2), hy * HALF / (SIZE[1] / 2)
    return np.asarray((np.abs(px + 0.8 * across) < 1) & (np.abs(py + 0.3 * down) < 1), np.float64)


def boxed_barrel(px: Floats, py: Floats, hx: Floats, hy: Floats) -> Floats:
    return boxed(px, py, hx, hy) * (np.hypot(px + 0.5 * hx, py + 0.5 * hy) < 1)


ALL = {
    "swirl": 0.4, "field_curvature": 0.2, "coma": 0.2, "anamorphic_focus": 0.1, "lateral_colour": 0.002,
    "matte_box_sides": 0.4, "matte_box_top": 0.2, "breathing": 1.0,
}  # fmt: skip
BOX = Aperture(matte_box_sides=0.8, matte_box_top=0.3)
EFFECTS: dict[str, tuple[Aperture, Shift, Passes]] = {
    "swirl": (Aperture(swirl=0.5), swirl, whole),
    "coma": (Aperture(coma=0.4), coma, whole),
    "field curvature": (Aperture(field_curvature=0.5), curved, whole),
    "anamorphic focus": (Aperture(anamorphic_focus=0.3), sideways, whole),
    "matte box": (BOX, straight, boxed),
    "swirl in a barrel and a matte box": (replace(BOX, swirl=0.5, vignetting=0.5), swirl, boxed_barrel),
}


class Plane:
    """A depth source: everything is equally far."""

    def __init__(self, distance: float) -> None:
        self._inverse = 1 / distance

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        shape = picture.shape[:2]
        inverse = np.full(shape, self._inverse, np.float32)
        return PixelDepth(inverse, np.ones(shape, np.float32), np.zeros(shape, bool))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def source(lamps: float) -> LinearRGBA:
    """(h, w, 4) linear: a texture with small lamps of a brightness."""
    picture = 0.3 * (texture(*SIZE).astype(np.float32) / 255) ** 2.2
    picture[20:130:32, 24:230:32] += lamps
    picture = cv2.GaussianBlur(picture, (0, 0), 1.2)
    return np.dstack([picture, np.ones(SIZE[::-1], np.float32)])


def meshed(
    aperture: Aperture, distance: float, focus: float, highlights: HighlightSettings, lamps: float
) -> Frame:
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Plane(distance))
    lens = FrameOptions(Focus(distance=focus), RADIUS, borrow=False, aperture=aperture, highlights=highlights)
    return mesh_frame(clip, 2, lens, SIZE, source(lamps))


def traced(
    shift: Shift, passes: Passes, distance: float, focus: float, lamps: float, count: int = TRACED
) -> LinearRGBA:
    """The mean over the aperture of what the rays to each pixel meet."""
    picture, total = source(lamps), np.zeros((*SIZE[::-1], 4), np.float32)
    light = np.zeros(SIZE[::-1])
    infinity = RADIUS * LENS.fx / focus
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5 - LENS.cx, np.arange(SIZE[1]) + 0.5 - LENS.cy)
    for px, py in vogel_disc(count):
        # Where a perfect lens sends the ray that meets a pixel.
        ux, uy = x, y
        for _ in range(8):
            dx, dy = shift(np.float64(px), np.float64(py), ux / HALF, uy / HALF)
            ux, uy = x - infinity * dx, y - infinity * dy
        away = RADIUS * LENS.fx * (1 / distance - 1 / focus)
        at_x, at_y = ux + away * px + LENS.cx - 0.5, uy + away * py + LENS.cy - 0.5
        share = passes(np.float64(px), np.float64(py), x / HALF, y / HALF)
        light += share
        met = cv2.remap(
            picture, at_x.astype(np.float32), at_y.astype(np.float32), cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REFLECT,
        )  # fmt: skip
        total += share[..., None].astype(np.float32) * met
    return total / light[..., None].astype(np.float32)


def error(mean: LinearRGBA, true: LinearRGBA) -> float:
    """PSNR in dB as displayed, away from the border."""
    inner = (slice(12, -12), slice(12, -12), slice(3))
    return psnr(*(encode_srgb(np.clip(part[inner].astype(np.float64), 0, 1)) for part in (mean, true)))


@needs_gpu
@pytest.mark.parametrize("distance", [NEAR, FAR, FOCUS], ids=["before", "behind", "in focus"])
@pytest.mark.parametrize("name", variants(reversed(EFFECTS), 2))
def test_views_are_shifted_as_traced_rays(name: str, distance: float) -> None:
    aperture, shift, passes = EFFECTS[name]
    true = traced(shift, passes, distance, FOCUS, 0.0)
    frame = meshed(aperture, distance, FOCUS, BY_VIEWS, 0.0)
    mean = draw_mean(frame.through())
    off = meshed(Aperture(), distance, FOCUS, BY_VIEWS, 0.0)
    without = error(draw_mean(off.through()), true)
    print(f"{frame.views} views: {error(mean, true):.1f} dB; without it {without:.1f}")
    assert error(mean, true) > 45
    assert without < error(mean, true) - 6 or (shift is straight and distance == FOCUS)


@needs_gpu
@pytest.mark.parametrize("name", variants(reversed(EFFECTS), 2))
def test_discs_of_lamps_are_as_traced_rays(name: str) -> None:
    aperture, shift, passes = EFFECTS[name]
    true = traced(shift, passes, FAR, FOCUS, 60.0, LAMPS_TRACED)
    mean = draw_mean(meshed(aperture, FAR, FOCUS, RESTORED, 60.0).through(24))
    print(f"{error(mean, true):.1f} dB")
    assert error(mean, true) > 40


def test_a_thin_lens_sees_less_as_it_focuses_nearer() -> None:
    # A lens of 50 mm half a metre away: the image distance is f Z / (Z - f), 55.6 mm.
    assert enlargement(1.0, 0.05, 2.0, 0.0) == pytest.approx(0.5 / 0.45)
    assert enlargement(0.2, 0.05, 2.0, 0.0) == pytest.approx(1 + 0.2 * 0.05 / 0.45)
    assert enlargement(1.0, 0.05, 0.5, 0.5) == 1
    assert enlargement(0.2, 0.05, 0.0, 2.0) == pytest.approx(1 / enlargement(0.2, 0.05, 2.0, 0.0))
    assert enlargement(-0.2, 0.05, 2.0, 0.0) < 1
    assert (
        LEAST_ENLARGED <= enlargement(1.0, 1.0, 0.0, 1.0) < enlargement(1.0, 1.0, 1.0, 0.0) <= MOST_ENLARGED
    )


@needs_gpu
@pytest.mark.parametrize(
    ("quality", "least"),
    [(NORMAL, 40), (replace(DRAFT, longest=SIZE[0] // 2), 36)],
    ids=["normal", "at half the size"],
)
@pytest.mark.parametrize("focus", [6.0, 12.0], ids=["nearer", "farther away"])
def test_breathing_enlarges_the_picture_and_fills_its_border(
    focus: float, quality: Quality, least: float
) -> None:
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Plane(FAR))
    lens = FrameOptions(
        Focus(distance=focus), 1e-4, borrow=False, grain=0.0, highlights=BY_VIEWS, sensor=1.2,
        aperture=Aperture(breathing=0.4), quality=quality,
    )  # fmt: skip
    picture = render_frame(clip, 2, lens, SIZE, lambda note: None)
    still = render_frame(clip, 2, replace(lens, sensor=0.0, quality=NORMAL), SIZE, lambda note: None)
    size = enlargement(0.4, 1.2 * LENS.fx / LENS.width, 1 / focus, 1 / clip.reconstruction.typical_depth)
    print(f"enlarged {size:.4f}")
    assert (size > 1.003) if focus < clip.reconstruction.typical_depth else (size < 0.997)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5 - LENS.cx, np.arange(SIZE[1]) + 0.5 - LENS.cy)
    at = (x / size + LENS.cx - 0.5).astype(np.float32), (y / size + LENS.cy - 0.5).astype(np.float32)
    true = cv2.remap(still, *at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    assert error(picture, true) > least
    assert picture[..., 3].min() > 0.999


@needs_gpu
def test_without_effects_nothing_is_shifted_to_the_bit() -> None:
    frame = meshed(Aperture(), FAR, FOCUS, RESTORED, 60.0)
    plain = frame.through(16)
    assert frame.lens == frame.lens.curved(0.0) and frame.steadied is None
    displacement = np.ones(SIZE[::-1], np.float32)
    assert plain.views.discs(displacement) is displacement
    # So small that shaders compute them and add nothing.
    tiny = replace(plain.views, aberrations=Aberrations(1e-30, 1e-30, 1e-30))
    assert bend_rows(tiny)[:, 2:].all() and not bend_rows(plain.views)[:, 2:].any()
    drawn = [draw_mean(replace(plain, views=each, highlight_discs=None)) for each in (plain.views, tiny)]
    np.testing.assert_array_equal(*drawn)


@needs_gpu
@pytest.mark.parametrize("aperture", [Aperture(field_curvature=0.1), Aperture(breathing=0.2)])
def test_methods_without_depth_refuse_what_they_cannot_draw(aperture: Aperture) -> None:
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Plane(FAR))
    lens = FrameOptions(Focus(points=(0, 1)), 0.1, method="thesis", aperture=aperture, sensor=1.0)
    with pytest.raises(UserError, match="the method thesis does not support field curvature or breathing"):
        mesh_frame(clip, 2, lens, SIZE, source(0.0))


@needs_gpu
def test_f12_and_the_preview_draw_all_effects_as_the_command_line(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    made = slanted_shot(tmp_path, LENS)
    settings = build(scene, made.footage, made.reconstruction)
    set_focus(settings, Focus(distance=6.0), 2)
    settings.blur, settings.views, settings.grain = 0.06, 24, 0.0
    for name, value in ALL.items():
        setattr(settings.shape, name, value)
    shot = shot_of(scene)
    options = frame_options(settings, shot.reconstruction)
    assert options.breathes and Aberrations.of(options.aperture).is_active
    drawn = render_frame(shot.context, 2, options, SIZE, lambda note: None)
    fine = make_picture(Wanted(shot, 2, options, SIZE), FINE)
    np.testing.assert_array_equal(fine.linear, drawn.astype(np.float16))
    scene.frame_set(2)
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(tmp_path / "f12.exr")
    bpy.ops.render.render(write_still=True)
    # Blender stores it without alpha's factor in between.
    np.testing.assert_allclose(read_picture(tmp_path / "f12.exr"), drawn, rtol=1e-6)
    plain = render_frame(shot.context, 2, replace(options, aperture=Aperture()), SIZE, lambda note: None)
    assert np.abs(plain - drawn).max() > 0.1
