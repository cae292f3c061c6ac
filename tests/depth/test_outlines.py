"""The outline of what moves, in a frame that is larger than the picture in which it was found."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Map, Mask
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.matte import matte
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.stereo_depth import upsampled, whole_depth

from ..scenes import texture

SIZE = (720, 960)
SMALL = (360, 480)
NEAR, FAR = 0.3, 0.1


def figure() -> Map:
    """(H, W) what of each pixel a head, a body and an arm cover."""
    fine = np.zeros((2 * SIZE[0], 2 * SIZE[1]), np.uint8)
    cv2.circle(fine, (960, 440), 200, 255, -1)
    cv2.ellipse(fine, (960, 1000), (170, 380), 20, 0, 360, 255, -1)
    cv2.line(fine, (1000, 860), (1500, 600), 255, 60)
    return cv2.resize(fine, SIZE[::-1], interpolation=cv2.INTER_AREA).astype(np.float32) / np.float32(255)


def shown(contrast: float) -> Map:
    """(H, W, 4) the figure before a wall, both textured, whose mean colours differ by so much."""

    def side(seed: int, colour: float) -> Map:
        coarse = cv2.resize(texture(160, 120, seed), SIZE[::-1], interpolation=cv2.INTER_CUBIC)
        blotches = 0.7 * coarse.astype(np.float32) + 0.3 * texture(*SIZE[::-1], seed + 1)
        return np.asarray(0.5 + 0.7 * (blotches / 255 - 0.5) + np.array([colour, 0, -colour]), np.float32)

    cover = figure()[..., None]
    noise = np.random.default_rng(1).normal(0, 0.01, (*SIZE, 3))
    display = np.clip(cover * side(3, contrast) + (1 - cover) * side(7, 0.0) + noise, 0, 1)
    return np.dstack([display**2.2, np.ones(SIZE)]).astype(np.float32)


def found(is_uneven: bool) -> DenseDepth:
    """What is known at half the size, with an outline that is a pixel off here and there."""
    mask = cv2.resize(figure(), SMALL[::-1], interpolation=cv2.INTER_AREA) > 0.5
    if is_uneven:
        noise = cv2.GaussianBlur(np.random.default_rng(2).normal(0, 1, SMALL), (0, 0), 3)
        inner, outer = (
            cv2.distanceTransform(side.astype(np.uint8), cv2.DIST_L2, 5) for side in (mask, ~mask)
        )
        mask = inner - outer + noise / noise.std() > 0
    inverse = np.where(mask, NEAR, FAR).astype(np.float32)
    return DenseDepth(
        1, inverse, np.ones_like(inverse), mask, Intrinsics(480, 360, 400.0, 400.0, 240.0, 180.0)
    )


def wrong(mask: Mask) -> float:
    """Pixels on the wrong side of the outline, for each pixel of it."""
    true = figure() > 0.5
    outline = (cv2.dilate(true.astype(np.uint8), np.ones((3, 3))) > 0) & ~true
    return float((mask != true).sum() / outline.sum())


@pytest.mark.parametrize(("contrast", "share"), [(0.0, 0.6), (0.25, 0.4)], ids=["alike", "another colour"])
def test_an_uneven_outline_is_that_of_the_picture(contrast: float, share: float) -> None:
    picture, depth = shown(contrast), found(is_uneven=True)
    by_colour = wrong(upsampled(depth.inverse_depth, picture) > 0.2)
    outlined = wrong(whole_depth(depth, picture).inverse_depth > 0.2)
    print(f"{by_colour:.2f} {outlined:.2f}")
    assert by_colour > 0.4 and outlined < share * by_colour


def test_an_even_outline_stays() -> None:
    picture, depth = shown(0.25), found(is_uneven=False)
    inverse = whole_depth(depth, picture).inverse_depth
    assert wrong(inverse > 0.2) < 0.15
    # No depth between.
    assert (np.abs(inverse - np.where(inverse > 0.2, NEAR, FAR)) < 1e-6).all()


def test_something_thin_before_it_keeps_its_own_depth() -> None:
    """Pickets of six pixels, three where depth is found."""
    picture, depth = shown(0.25), found(is_uneven=False)
    pickets = np.zeros(SIZE, bool)
    for left in range(300, 700, 60):
        pickets[:, left : left + 6] = True
    picture[pickets, :3] = 0.7 * texture(*SIZE[::-1], 9)[pickets] / 255
    small = pickets[::2, ::2]
    inverse, moving = np.where(small, 0.5, depth.inverse_depth).astype(np.float32), depth.moving & ~small
    result = whole_depth(DenseDepth(1, inverse, depth.confidence, moving, depth.pinhole), picture)
    assert np.mean(np.abs(result.inverse_depth[pickets] - 0.5) > 0.01) < 0.02


def test_a_sharp_probability_has_no_halo_on_ground_of_its_colours() -> None:
    """Without its sharpness the filter finds the subject's colours in the ground around."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.uniform(0, 255, (360, 640, 3)).astype(np.float32), (0, 0), 1.5)
    disc = cv2.circle(np.zeros((360, 640), np.uint8), (320, 180), 90, 255, -1)
    picture = np.where(disc[..., None] > 0, 110, 128 + 3 * (noise - 128)).clip(0, 255).astype(np.uint8)
    away = cv2.distanceTransform((disc == 0).astype(np.uint8), cv2.DIST_L2, 5)
    halo = {}
    for blur in (1.0, 4.0):
        halo[blur] = float(matte(picture, cv2.GaussianBlur(disc, (0, 0), blur))[away > 8].max())
    assert halo[1.0] == 0 and halo[4.0] > 0.1
