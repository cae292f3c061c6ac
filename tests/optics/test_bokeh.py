"""The picture of an aperture is the light that its virtual cameras stand for."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.optics.aperture import Aperture, ApertureImage, aperture_samples
from addon.core.optics.bokeh import CORNER, MARGIN, bokeh_picture

SIZE = 128
L_SHAPE = np.zeros((20, 20), np.float32)
L_SHAPE[:, :6] = L_SHAPE[14:, :] = 1


def places(size: int = SIZE) -> np.ndarray:
    """(size, size, 2) middles of the pixels in radii of the aperture."""
    margin = round(size * (1 - 1 / MARGIN) / 2)
    at = (np.arange(size) + 0.5 - margin) * 2 / (size - 2 * margin) - 1
    return np.stack(np.meshgrid(at, at), axis=-1)


@pytest.mark.parametrize(
    "aperture",
    [
        Aperture(blades=5, rotation=0.4),
        Aperture(ratio=1.6),
        Aperture(obstruction=0.5),
        Aperture(spherical_aberration=0.8),
        Aperture(image=ApertureImage(L_SHAPE)),
    ],
    ids=["blades", "oval", "mirror", "bubble", "picture"],
)
def test_it_has_the_moments_of_the_virtual_cameras(aperture: Aperture) -> None:
    samples = aperture_samples(aperture, 128)
    weights = np.full(128, 1 / 128) if samples.weights is None else samples.weights
    light = bokeh_picture(aperture, SIZE)[..., 1]
    share = (light / light.sum())[..., None]
    mean = (share * places()).sum(axis=(0, 1))
    assert mean == pytest.approx(weights @ samples.positions, abs=0.02)
    spread = (share * (places() - mean) ** 2).sum(axis=(0, 1))
    # A camera stands for a share of the aperture, which has a spread of its own: that of a disc.
    own = samples.spread**2 / 128 / 4
    seen = weights @ (samples.positions - weights @ samples.positions) ** 2 + own
    assert spread == pytest.approx(seen, rel=0.04)


def test_cats_eyes_are_cut_towards_the_corners() -> None:
    light = bokeh_picture(Aperture(vignetting=0.8), 3 * SIZE)[..., 1]
    whole = bokeh_picture(Aperture(), SIZE)[..., 1]
    parts = {
        (row, column): light[row * SIZE :, column * SIZE :][:SIZE, :SIZE]
        for row in range(3)
        for column in range(3)
    }
    assert parts[1, 1].sum() == pytest.approx(whole.sum(), rel=0.01)
    # The overlap of two circles whose middles are d apart (Ray 2002).
    for where, d in {(1, 2): 0.8 * CORNER, (0, 0): 0.8}.items():
        lens = 2 * np.arccos(d / 2) - d / 2 * np.sqrt(4 - d**2)
        assert parts[where].sum() / whole.sum() == pytest.approx(lens / np.pi, rel=0.02)
    # What lies towards the corner is lost.
    assert parts[0, 0][: SIZE // 2, : SIZE // 2].sum() < parts[0, 0][SIZE // 2 :, SIZE // 2 :].sum()
    for turned in (parts[0, 2][:, ::-1], parts[2, 0][::-1], parts[2, 2][::-1, ::-1]):
        assert np.allclose(parts[0, 0], turned, atol=1e-6)


@pytest.mark.parametrize("vignetting", [0.0, 0.6])
def test_colors_that_focus_farther_away_have_smaller_discs_of_the_same_light(vignetting: float) -> None:
    size = 3 * SIZE
    light = bokeh_picture(Aperture(spherical_aberration=-0.5, axial_colour=0.2, vignetting=vignetting), size)
    green = bokeh_picture(Aperture(spherical_aberration=-0.5, vignetting=vignetting), size)
    assert (light[..., 0] == light[..., 2]).all() and (green[..., 0] == green[..., 1]).all()
    # Green is as without it, but for what counts as white.
    shown = (green[..., 1] > 0.1) & (green[..., 1] < 1)
    assert np.ptp(light[shown, 1] / green[shown, 1]) < 1e-5
    part = np.s_[SIZE : 2 * SIZE, SIZE : 2 * SIZE] if vignetting else np.s_[:, :]
    energy = light[part].sum(axis=(0, 1))
    assert energy[0] == pytest.approx(energy[1], rel=0.01)
    squared = (places(len(light[part])) ** 2).sum(axis=-1, keepdims=True)
    spread = (light[part] * squared).sum(axis=(0, 1)) / energy
    assert np.sqrt(spread[0] / spread[1]) == pytest.approx(0.8, rel=0.01)
