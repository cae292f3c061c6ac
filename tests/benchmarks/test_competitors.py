"""The competitors do what they claim: discs of the right size, and nothing else changed."""

from __future__ import annotations

import bpy
import cv2
import numpy as np
import pytest

from benchmarks.accuracy.defocus import defocus
from benchmarks.accuracy.metrics import psnr
from benchmarks.accuracy.scatter import scatter

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


def test_defocus_leaves_what_is_in_focus() -> None:
    picture = noise(60, 90)
    depth = np.full((60, 90), FOCUS)
    assert psnr(defocus(picture, depth, FOCAL, RADIUS, FOCUS, 8), picture) > 60
    depth[:, 45:] = np.inf
    out = defocus(picture, depth, FOCAL, RADIUS, FOCUS, 8)
    assert out[:, :45] == pytest.approx(picture[:, :45], abs=1e-6)
    assert psnr(out[:, 45:], picture[:, 45:]) < 30


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
