"""The competitors do what they claim: discs of the right size, and nothing else changed."""

from __future__ import annotations

import bpy
import cv2
import numpy as np
import pytest

from addon.core.media.light import to_linear
from benchmarks.accuracy.defocus import defocus
from benchmarks.accuracy.metrics import psnr
from benchmarks.accuracy.scatter import layer_discs, scatter

from ..scenes import texture

FOCAL, RADIUS, FOCUS = 700.0, 0.02, 5.0


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    """Random light, a part of it far over white."""
    return (3 * np.random.default_rng(seed).random((height, width, 3)) ** 3).astype(np.float32)


def light(height: int = 96, width: int = 120) -> np.ndarray:
    """One pixel of light in the middle."""
    picture = np.zeros((height, width, 3), dtype=np.float32)
    picture[height // 2, width // 2] = 100
    return picture


def disc_of(spread: np.ndarray) -> tuple[float, float]:
    """Diameters across and down of the disc that a pixel of light became.

    A disc's variance along an axis is D^2 / 16, and pixels add 1 / 12 (Sheppard's correction: good to 0.1 px
    from five pixels on).
    """
    energy = spread[..., 1].astype(np.float64)
    found = []
    for axis in (0, 1):
        profile = energy.sum(axis=axis)
        at = np.arange(profile.size)
        mean = np.average(at, weights=profile)
        variance = np.average((at - mean) ** 2, weights=profile)
        found.append(4 * np.sqrt(max(variance - 1 / 12, 0)))
    return found[0], found[1]


def depth_with(disc: np.ndarray) -> np.ndarray:
    """Depth that gives the signed discs with FOCAL, RADIUS and FOCUS."""
    return np.asarray(1 / (1 / FOCUS + disc / (2 * RADIUS * FOCAL)))


# Scatter


@pytest.mark.parametrize("disc", [5.0, 7.4, 16.0, 40.0, -7.4, -40.0])
def test_scatter_spreads_light_over_its_disc(disc: float) -> None:
    spread = scatter(light(), np.full((96, 120), disc))
    assert disc_of(spread) == pytest.approx((abs(disc), abs(disc)), abs=0.1)
    # All of the light, and evenly: its height is its energy over the disc's area.
    assert spread[..., 1].sum() == pytest.approx(100, rel=1e-4)
    assert spread[48, 60, 1] == pytest.approx(100 / (np.pi * disc**2 / 4), rel=0.05)


def test_one_depth_is_one_convolution() -> None:
    """Against the share of each pixel that is in the disc, counted on a fine grid."""
    y, x = (np.mgrid[0 : 9 * 64, 0 : 9 * 64] + 0.5) / 64 - 4.5
    inside = (x**2 + y**2 <= 3.5**2).reshape(9, 64, 9, 64).mean(axis=(1, 3))
    picture = noise(40, 60)
    expected = cv2.filter2D(picture, -1, inside / inside.sum(), borderType=cv2.BORDER_REPLICATE)
    for disc in (7.0, -7.0):
        assert scatter(picture, np.full((40, 60), disc)) == pytest.approx(expected, abs=2e-3)


def test_nearer_spreads_over_farther_with_a_soft_edge() -> None:
    """A white near half plane before a sharp black one: the segment of the disc that lies past the edge."""
    picture, disc = np.zeros((80, 120, 3), np.float32), np.zeros((80, 120))
    picture[:, :60], disc[:, :60] = 1, 20
    out = scatter(picture, disc)[40, :, 0]
    past = np.arange(60, 75) + 0.5 - 60
    share = np.clip(past / 10, 0, 1)
    segment = (np.arccos(share) - share * np.sqrt(1 - share**2)) / np.pi
    assert out[60:75] == pytest.approx(segment, abs=0.01)
    assert np.all(out[:50] == 1)


def test_the_background_does_not_bleed_over_the_subject() -> None:
    picture, disc = noise(80, 120), np.zeros((80, 120))
    picture[:, 60:], disc[:, 60:] = 5, -40
    out = scatter(picture, disc)
    assert np.array_equal(out[:, :60], picture[:, :60])
    # Nor the subject's colours into the background, which is even.
    assert out[:, 60:] == pytest.approx(5, rel=1e-5)


def test_nothing_shines_through_a_slanted_surface() -> None:
    """A black floor in many layers before a white, far more blurred wall."""
    picture, disc = np.zeros((120, 200, 3), np.float32), np.tile(np.linspace(1, 10, 200), (120, 1))
    picture[:40], disc[:40] = 1, -60
    out = scatter(picture, disc)
    # The floor's own edge is half see-through over its disc's radius, up to 5 pixels; the wall's reach is 30.
    assert out[47:].max() < 0.02


def test_the_layers_hold_every_disc_between_them() -> None:
    for lowest, highest in ((-64.0, 30.0), (0.0, 0.0), (2.0, 7.3), (-5.0, -4.0)):
        levels = layer_discs(lowest, highest)
        assert levels[0] <= lowest and levels[-1] >= highest
        assert np.all(np.diff(levels) > 0) and 0 in levels
        assert np.all(np.diff(levels) <= np.maximum(1, 0.05 * np.abs(levels[1:])) + 1e-9)


# Blender's Defocus node


@pytest.mark.parametrize("size", [(96, 120), (120, 96)], ids=["landscape", "portrait"])
@pytest.mark.parametrize("depth", [1.5, 2.5, 20.0, np.inf])
@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_defocus_spreads_light_over_its_disc(size: tuple[int, int], depth: float, unit: float) -> None:
    wanted = 2 * RADIUS * FOCAL * abs(1 / depth - 1 / FOCUS)
    spread = defocus(
        light(*size), np.full(size, depth * unit), FOCAL, RADIUS * unit, FOCUS * unit, wanted / 2
    )
    assert disc_of(spread) == pytest.approx((wanted, wanted), abs=1)
    assert spread[..., 1].sum() == pytest.approx(100, rel=1e-4)


def test_a_wide_aperture_keeps_its_disc() -> None:
    # The node's film distance differs most from ours where the aperture is as wide as the focus is far.
    focal, radius, focus, depth = 60.0, 2.0, 4.0, 8.0
    wanted = 2 * radius * focal * (1 / focus - 1 / depth)
    spread = defocus(light(), np.full((96, 120), depth), focal, radius, focus, wanted / 2)
    assert disc_of(spread) == pytest.approx((wanted, wanted), abs=1)


def test_defocus_leaves_what_is_in_focus() -> None:
    picture = noise(60, 90)
    depth = np.full((60, 90), FOCUS)
    assert psnr(defocus(picture, depth, FOCAL, RADIUS, FOCUS, 8), picture) > 60
    depth[:, 45:] = np.inf
    out = defocus(picture, depth, FOCAL, RADIUS, FOCUS, 8)
    assert out[:, :45] == pytest.approx(picture[:, :45], abs=1e-6)
    assert psnr(out[:, 45:], picture[:, 45:]) < 30


def test_both_blur_an_even_depth_alike() -> None:
    picture = to_linear(texture(160, 90))[..., :3]
    disc = np.full((90, 160), -5.0)
    node = defocus(picture, depth_with(disc), FOCAL, RADIUS, FOCUS, 2.5)
    assert psnr(node, scatter(picture, disc)) > psnr(picture, scatter(picture, disc)) + 10


def test_blur_max_cuts_discs_short() -> None:
    depth = np.full((96, 120), 1.5)
    cut = defocus(light(), depth, FOCAL, RADIUS, FOCUS, 3)
    assert disc_of(cut) == pytest.approx((6, 6), abs=1)


def data_blocks() -> dict[str, list[str]]:
    collections = (p for p in bpy.data.bl_rna.properties if p.type == "COLLECTION")
    return {p.identifier: sorted(b.name for b in getattr(bpy.data, p.identifier)) for p in collections}


def test_defocus_leaves_nothing_behind() -> None:
    window = bpy.context.window
    before, shown = data_blocks(), window and window.scene
    defocus(noise(20, 30), np.full((20, 30), 3.0), FOCAL, RADIUS, FOCUS, 4)
    assert data_blocks() == before
    assert (window and window.scene) == shown
    with pytest.raises(ValueError, match="depth"):
        defocus(noise(20, 30), np.zeros((30, 20)), FOCAL, RADIUS, FOCUS, 4)
    with pytest.raises(ValueError, match="radius"):
        defocus(noise(20, 30), np.full((20, 30), 3.0), FOCAL, 0.0, FOCUS, 4)
    assert data_blocks() == before
