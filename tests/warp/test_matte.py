"""A soft matte as the alpha of what is before a wall: hair, thinner than pixels, against a true lens."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.source import FAINTEST, NO_PICTURE, PixelDepth
from addon.core.depth.stereo_depth import StereoDepth
from addon.core.frame.views import Views
from addon.core.optics.aperture import ApertureSamples
from addon.core.optics.aperture_sampling import vogel_disc
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.disocclusion_fill import HiddenColours
from addon.core.warp.layered_depth_image import split
from addon.core.warp.layered_mesh import layer_mesh
from addon.core.warp.matting import corrected
from addon.render.views import gpu_views

from ..scenes import texture
from ..variants import combined

SIZE = (160, 200)
FINE = 8
"""Samples across a pixel."""
NEAR, FAR = 10.0, 1.0
"""Displacement at the aperture's rim, in pixels."""
LENS = Intrinsics(SIZE[1], SIZE[0], 150.0, 150.0, SIZE[1] / 2, SIZE[0] / 2)
VIEWS = 48


class Scene(NamedTuple):
    """Something hairy before a wall, `FINE` times as fine."""

    opacity: Map
    colour: Map
    wall: Map


@cache
def hair() -> Scene:
    """A head from whose rim strands of half a pixel stand out by 20 pixels."""
    height, width = (FINE * n for n in SIZE)
    opacity = np.zeros((height, width), np.uint8)
    middle, rng = np.array([width / 2, height / 2]), np.random.default_rng(2)
    cv2.circle(opacity, tuple(middle.astype(int).tolist()), 36 * FINE, 255, -1)
    for angle in np.linspace(0, 2 * np.pi, 240, endpoint=False):
        bend, reach = rng.normal(0, 0.12), rng.uniform(44, 58)
        steps = np.linspace(34, reach, 12)
        turned = angle + bend * (steps - 34) / 20
        line = middle + FINE * steps[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
        cv2.polylines(opacity, [np.rint(line).astype(np.int32)], False, 255, FINE // 2)
    wall = cv2.resize(texture(SIZE[1], SIZE[0], 5), (width, height), interpolation=cv2.INTER_CUBIC)
    colour = 0.12 + 0.1 * cv2.resize(texture(SIZE[1], SIZE[0], 6), (width, height)).astype(np.float32) / 255
    return Scene(opacity.astype(np.float32) / 255, colour, wall.astype(np.float32) / 255)


def seen(across: float = 0.0, down: float = 0.0, focus: float = 0.0) -> Map:
    """(H, W, 3) from a place on the aperture, in shares of its radius, in register at the focal plane."""
    scene, size = hair(), (FINE * SIZE[1], FINE * SIZE[0])

    def moved(picture: Map, disparity: float) -> Map:
        by = FINE * (disparity - focus) * np.array([across, down])
        matrix = np.array([[1, 0, by[0]], [0, 1, by[1]]])
        return np.asarray(cv2.warpAffine(picture, matrix, size, borderMode=cv2.BORDER_REFLECT))

    opacity = moved(scene.opacity, NEAR)[..., None]
    picture = opacity * moved(scene.colour, NEAR) + (1 - opacity) * moved(scene.wall, FAR)
    return np.asarray(cv2.resize(picture, SIZE[::-1], interpolation=cv2.INTER_AREA))


def matte() -> Map:
    return np.asarray(cv2.resize(hair().opacity, SIZE[::-1], interpolation=cv2.INTER_AREA))


def drawn(depth: PixelDepth, focus: float, hidden: HiddenColours | None) -> Map:
    """(H, W, 3) through the lens, as a frame is drawn."""
    gpu_views.check_gpu()
    picture = np.dstack([seen(), np.ones(SIZE)]).astype(np.float32)
    thin, offsets = ThinLens(LENS, 1.0, focus / LENS.fx), vogel_disc(VIEWS)
    views = Views(Canvas(LENS), thin).placed(ApertureSamples(offsets))
    layers = layer_mesh(picture, depth, thin, hidden)
    return np.asarray(gpu_views.mean_of_views(views, layers)[..., :3])


def depth_of(opacity: Map, is_soft: bool) -> PixelDepth:
    inverse = np.where(opacity > (FAINTEST if is_soft else 0.5), NEAR, FAR) / LENS.fx
    return PixelDepth(inverse, opacity=opacity if is_soft else None)


def the_wall(places: Floats, _: Floats) -> tuple[Map, np.ndarray]:
    """What other frames saw behind."""
    behind = cv2.resize(hair().wall, SIZE[::-1], interpolation=cv2.INTER_AREA)
    if not len(places):
        return np.zeros((0, 3), np.float32), np.zeros(0, bool)
    at = (np.asarray(places)[None] - 0.5).astype(np.float32)
    inside = ((places > 0) & (places < SIZE[::-1])).all(axis=1)
    found = cv2.remap(behind, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return found.reshape(-1, 3), inside


def psnr_in_band(picture: Map, true: Map) -> float:
    """dB where the matte is a fraction, and 6 pixels around."""
    fraction = (matte() > FAINTEST) & (matte() < 1 - FAINTEST)
    band = cv2.dilate(fraction.astype(np.uint8), np.ones((13, 13))) > 0
    return float(-10 * np.log10(np.mean((picture - true)[band] ** 2)))


@pytest.mark.parametrize(
    ("focus", "hidden"),
    combined({"wall in focus": FAR, "hair in focus": NEAR}, {"made up": None, "seen by others": the_wall}),
)
def test_hair_with_a_soft_matte_is_nearer_to_a_real_lens(focus: float, hidden: HiddenColours | None) -> None:
    true = np.mean([seen(*offset, focus) for offset in vogel_disc(VIEWS)], axis=0)
    hard, soft = (
        psnr_in_band(drawn(depth_of(matte(), is_soft), focus, hidden), true) for is_soft in (False, True)
    )
    print(f"hard {hard:.2f} soft {soft:.2f}")
    assert soft > hard + 2


class Found(NamedTuple):
    """Stands for stereo fused over time: what moves is found a quarter as fine, without hair."""

    def at(self, frame: int) -> DenseDepth:
        size = (SIZE[1] // 4, SIZE[0] // 4)
        moving = cv2.resize(matte(), size, interpolation=cv2.INTER_AREA) > FAINTEST
        inverse = np.where(moving, NEAR, FAR).astype(np.float32) / np.float32(LENS.fx)
        return DenseDepth(frame, inverse, np.ones_like(inverse), moving, LENS.scaled(*size))


@pytest.mark.parametrize("camera", [LENS, replace(LENS, k1=-0.08)], ids=["straight", "bent"])
def test_depth_of_a_clip_ends_at_the_outline_of_its_matte(camera: Intrinsics) -> None:
    """Upsampling by colour would not: strands are finer than what depth is found at."""
    canvas = Canvas(camera)
    picture = canvas.from_source(np.dstack([seen(), np.ones(SIZE)]).astype(np.float32))
    source = StereoDepth(Found(), masks=lambda _: matte())  # type: ignore[arg-type]
    depth = source.at(1, canvas, picture)
    assert depth.opacity is not None and depth.opacity.shape == depth.inverse_depth.shape == picture.shape[:2]
    covered = depth.opacity > FAINTEST
    assert np.ptp(depth.opacity) == 1 and 0.1 < covered.mean() < 0.5
    np.testing.assert_allclose(depth.inverse_depth[covered], NEAR / LENS.fx, rtol=1e-5)
    if not camera.is_distorted:
        off = np.abs(depth.inverse_depth[~covered] - FAR / LENS.fx) > 1e-5
        assert off.mean() < 0.001
    # Where nothing is asked of a picture's pixels it is the depth as it was found.
    assert source.at(1, canvas, NO_PICTURE).opacity is None


def test_a_matte_is_of_what_is_behind_something_nearer_too() -> None:
    """A post before the hair: its silhouettes, where the matte ends as well, are its own."""
    opacity = matte()
    post = slice(96, 104)
    opacity[:, post] = 0
    disparity = np.where(opacity > FAINTEST, NEAR, FAR).astype(np.float32)
    disparity[:, post] = 2 * NEAR
    picture = np.dstack([seen(), np.ones(SIZE)]).astype(np.float32)
    picture[:, post, :3] = [0.9, 0.1, 0.1]
    alone, given = (split(picture, disparity, 4.0, 4.0, opacity=each) for each in (None, opacity))
    inner = np.s_[40:120, post]
    np.testing.assert_array_equal(given.front[inner], alone.front[inner])
    assert (given.front[inner][..., 3] == 1).mean() > 0.7


def test_a_wrong_background_is_corrected_where_little_is_before_it() -> None:
    alpha = np.array([0.1, 0.5, 0.9], np.float32)
    near, far = np.full((3, 3), 0.1, np.float32), np.full((3, 3), 0.6, np.float32)
    pixel = alpha[:, None] * near + (1 - alpha[:, None]) * 0.4
    miss = np.abs(corrected(pixel, alpha, near, far) - 0.4)[:, 0]
    assert miss[0] < 0.05 < 0.15 < miss[1] < miss[2] < 0.2
    right = alpha[:, None] * near + (1 - alpha[:, None]) * far
    np.testing.assert_allclose(corrected(right, alpha, near, far), far, atol=1e-6)
