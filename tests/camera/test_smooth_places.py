"""Places of all pixels by a polynomial, against the lens and shutter at each pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.camera.canvas import Canvas, SmoothPlaces
from addon.core.camera.reconstruction import Intrinsics
from tests.lenses import TERMS, lens_of

SIZE = (160, 120)


def centres(width: int, height: int) -> Floats:
    return np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)


def rolling(lens: Intrinsics) -> Intrinsics:
    return replace(lens, turn=(0.01, -0.02, 0.015), largest_turn=0.03, readout=(0.0, 0.6))


@pytest.mark.parametrize("shutter", [False, True], ids=["global", "rolling"])
@pytest.mark.parametrize("model", TERMS)
def test_pixels_are_where_the_lens_puts_them(model: str, shutter: bool) -> None:
    lens = lens_of(model).scaled(*SIZE)
    canvas = Canvas(rolling(lens) if shutter else lens)
    pinhole = canvas.pinhole
    true = canvas.features_to_source(centres(pinhole.width, pinhole.height)) - 0.5
    found = SmoothPlaces(pinhole.width, pinhole.height, canvas.features_to_source).rows(0, pinhole.height)
    np.testing.assert_allclose(found - 0.5, true, rtol=0, atol=1e-9)
    # The last digit of a float32.
    np.testing.assert_allclose(canvas.canvas_map(), true, rtol=1.2e-7, atol=1e-6)
    true = canvas.features_from_source(centres(*SIZE)) - 0.5
    np.testing.assert_allclose(canvas.source_map(), true, rtol=1.2e-7, atol=1e-6)


@pytest.mark.parametrize("value", [np.nan, 7.0])
def test_what_is_not_smooth_is_evaluated_at_each_pixel(value: float) -> None:
    def torn(xy: Floats) -> Floats:
        return np.where(xy[..., :1] > 40, value, xy)

    np.testing.assert_array_equal(SmoothPlaces(64, 48, torn).rows(0, 48), torn(centres(64, 48)))
