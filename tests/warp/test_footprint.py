"""The prefilter of a layered mesh's texture: what stays as it is, what is spread, and by how much."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGBA, Mask
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.footprint import RADII, prefilter
from addon.core.warp.layer import OWN, Layer
from addon.core.warp.layered_mesh import FINER, layer_mesh

SIZE = (120, 160)
Y, X = np.mgrid[: SIZE[0], : SIZE[1]] + 0.5
NEAR, FAR, RADIUS = 12.0, 2.0, 28
COVER = np.hypot(X - 80, Y - 60) < RADIUS
DISPARITY = np.where(COVER, NEAR, FAR)
LENS = ThinLens(Intrinsics(SIZE[1], SIZE[0], 150.0, 150.0, 80.0, 60.0), 1.0, 0.0)
"""Disparity at its rim is 150 times inverse depth."""


def picture(near: Floats | float = 0.8, far: Floats | float = 0.2) -> LinearRGBA:
    """(H, W, 4) a disc before a wall; grey."""
    grey = np.where(COVER, near, far)
    return np.dstack([grey, grey, grey, np.ones(SIZE)]).astype(np.float32)


def blurred(
    shown: LinearRGBA, radius: Callable[[Floats], Floats], focus: float = FAR
) -> tuple[LinearRGBA, LinearRGBA, tuple[Layer, ...]]:
    """Pictures of the layers (n, h, w, 4) before and after, and the layers."""
    layers = layer_mesh(shown, PixelDepth(DISPARITY / 150), replace(LENS, focus=focus / 150))
    before = np.stack([each.picture for each in layers])
    prefilter(layers, radius)
    return before, np.stack([each.picture for each in layers]), layers


@pytest.mark.parametrize("radius", [*RADII[1:11:4], 2.0, 7.0])
def test_lamps_become_their_footprint_and_keep_their_energy(radius: float) -> None:
    """Their variance along either axis is that of a disc, of the levels and between them."""
    shown = np.zeros((*SIZE, 4), np.float32)
    shown[..., 3] = 1
    shown[60, 80, :3] = 1000
    layers = layer_mesh(shown, PixelDepth(np.full(SIZE, FAR / 150)), LENS)
    before = layers[-1].picture[..., 0].astype(np.float64)
    prefilter(layers, lambda disparity: np.full(disparity.shape, radius / FINER))
    after = layers[-1].picture[..., 0].astype(np.float64)
    assert after.sum() == pytest.approx(before.sum(), rel=1e-4)
    assert variance(after) - variance(before) == pytest.approx(radius**2 / 4, rel=1e-3)


def variance(light: Floats) -> float:
    """Of where it is, in texels squared, along either axis."""
    y, x = np.mgrid[: light.shape[0], : light.shape[1]]
    share = light / light.sum()
    return float(np.mean([(share * (axis - (share * axis).sum()) ** 2).sum() for axis in (x, y)]))


def test_what_is_in_focus_is_untouched() -> None:
    grain = np.random.default_rng(0).random(SIZE)
    before, after, layers = blurred(picture(grain, grain), lambda d: np.where(d > 6 - NEAR, 0.0, 4.0), NEAR)
    near = np.repeat(np.repeat(layers[0].disparity > 6 - NEAR, FINER, 0), FINER, 1)
    assert near.any()
    np.testing.assert_array_equal(after[0][near], before[0][near])
    # The wall beside it is not.
    assert np.abs(after[-1] - before[-1]).max() > 0.1


def test_nothing_bleeds_from_one_surface_into_another() -> None:
    """The disc is red and the wall blue: however wide the blur, the disc's own part stays without blue, and
    what shows of the wall without red."""
    shown = picture()
    shown[..., :3] = np.where(COVER[..., None], [0.9, 0, 0], [0, 0, 0.7])
    _, after, layers = blurred(shown, lambda disparity: np.full(disparity.shape, 5.0))
    layer, behind = layers
    margin = (layer.alpha.shape[0] - SIZE[0]) // 2
    away = np.pad(np.hypot(X - 80, Y - 60) - RADIUS, margin, constant_values=99.0)

    def fine(mask: Mask) -> Mask:
        return np.repeat(np.repeat(mask, FINER, 0), FINER, 1)

    masks = away < -4, (away > 2) & (layer.alpha == 0)
    inside, past = (after[0][fine(layer.covered & mask)] for mask in masks)
    # Mixed pixels have a little of both to begin with; what bled would have up to half.
    assert inside[:, 2].max() < 0.05 and past[:, 2].max() < 0.05
    assert inside[:, 0].max() > 0.8 and past[:, 3].max() > 0.1 and past[:, 3].max() < 0.6
    shown = (behind.origin != OWN) & (away > FAR - NEAR) & (away < 0)
    shows = fine(shown | ((away > 2) & (away < 20)))
    assert after[-1][shows, 0].max() < 0.02


def test_the_border_between_parts_is_one() -> None:
    """What lies below each other in the texture has nothing to do with each other."""
    bright = picture(0.2, 0.2)
    bright[-3:, :, :3] = 50.0
    _, after, layers = blurred(bright, lambda disparity: np.full(disparity.shape, 6.0))
    margin = (layers[0].alpha.shape[0] - SIZE[0]) // 2
    assert after[-1][: FINER * (margin // 2), :, 0].max() < 0.3
