"""Shapes of the aperture: their light, and the virtual cameras that stand for it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.base.options import options_of
from addon.core.optics.aperture import Aperture, ApertureImage, aperture_samples

from ..variants import combined

SIZE = 400


def heart() -> ApertureImage:
    """A picture that is lopsided both ways, in shades."""
    place = np.linspace(-1, 1, 64)
    x, y = np.meshgrid(place, place)
    light = np.where((x > -0.5) & (y < 0.3 * x), 1.0 + 0.8 * x, 0.0)
    return ApertureImage(light.astype(np.float32))


SHAPES = {
    "pentagon": Aperture(blades=5),
    "turned hexagon": Aperture(blades=6, rotation=0.3, roundness=0.4),
    "anamorphic": Aperture(ratio=2.0),
    "turned and squeezed": Aperture(ratio=1.5, blades=7, rotation=0.4),
    "mirror": Aperture(obstruction=0.5),
    "apodised": Aperture(apodisation=0.9),
    "soap bubble": Aperture(spherical_aberration=0.8),
    "creamy": Aperture(spherical_aberration=-0.8),
    "picture": Aperture(image=heart()),
}


def moments(places: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mean (2,) and the spread (2, 2) of weighted places."""
    weights = weights / weights.sum()
    mean = weights @ places
    away = places - mean
    return mean, (away * weights[:, None]).T @ away


def dense(shape: Aperture) -> tuple[np.ndarray, np.ndarray]:
    """Places on a fine raster, and the light there, straight from its definition."""
    place = (np.arange(SIZE) + 0.5) * 2 / SIZE - 1
    x, y = np.meshgrid(place, place)
    return np.column_stack([x.ravel(), y.ravel()]), shape.light(x, y).ravel()


@pytest.mark.parametrize(("shape", "count"), combined(SHAPES, [8, 24, 64, 200]))
def test_views_have_the_moments_of_the_light(shape: Aperture, count: int) -> None:
    samples = aperture_samples(shape, count)
    assert samples.weights is not None
    assert len(samples.positions) == len(samples.weights) == count
    assert samples.weights.sum() == pytest.approx(1, abs=1e-12)
    mean, spread = moments(samples.positions, samples.weights)
    true_mean, true_spread = moments(*dense(shape))
    np.testing.assert_allclose(mean, true_mean, atol=2e-3)
    # Each view stands for a disc whose spread is a quarter of its squared radius.
    own = samples.spread**2 / count / 4 * np.eye(2)
    tolerance = 0.05 if count >= 24 else 0.25
    np.testing.assert_allclose(spread + own, true_spread, atol=tolerance * true_spread.max())


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_many_views_integrate_a_picture_seen_through_the_aperture(shape: Aperture) -> None:
    def seen(places: np.ndarray) -> np.ndarray:
        x, y = places.T
        return np.exp(-((x - 0.2) ** 2) - 2 * y**2) + 0.3 * np.sin(3 * x - 2 * y)

    places, light = dense(shape)
    true = light @ seen(places) / light.sum()
    samples = aperture_samples(shape, 128)
    assert samples.weights @ seen(samples.positions) == pytest.approx(true, abs=5e-3)


@pytest.mark.parametrize("blades", [3, 5, 8])
def test_a_polygon_has_its_area(blades: int) -> None:
    shape = Aperture(blades=blades, rotation=0.2)
    area = np.pi * aperture_samples(shape, 16).spread ** 2
    assert area == pytest.approx(blades / 2 * np.sin(2 * np.pi / blades), rel=5e-3)
    corner = 0.2 + np.pi / blades
    inside, outside = (np.array([[r * np.cos(corner)], [-r * np.sin(corner)]]) for r in (0.99, 1.01))
    assert shape.light(*inside)[0] == 1
    assert shape.light(*outside)[0] == 0


def test_views_are_where_light_passes() -> None:
    ring = aperture_samples(SHAPES["mirror"], 40)
    assert np.hypot(*ring.positions.T).min() > 0.5
    narrow = aperture_samples(SHAPES["anamorphic"], 40)
    assert np.abs(narrow.positions).max(axis=0) == pytest.approx([0.45, 0.9], abs=0.08)
    picture = aperture_samples(SHAPES["picture"], 40)
    assert picture.positions[:, 0].min() > -0.5
    # More light passes to the right.
    right = picture.positions[:, 0] > 0.5
    assert picture.weights[right].mean() > 1.2 * picture.weights[~right].mean()


@pytest.mark.parametrize(
    ("name", "value"),
    [("blades", 40), ("ratio", 0.0), ("obstruction", 1.0), ("apodisation", 1.0), ("roundness", -0.1),
     ("spherical_aberration", 1.5), ("vignetting", float("nan")), ("axial_colour", 0.6)],
)  # fmt: skip
def test_shapes_that_mean_nothing_are_refused(name: str, value: float) -> None:
    with pytest.raises(
        UserError, match=rf"^{re.escape(options_of(Aperture)[name].phrase)} cannot be .*; give a number"
    ):
        Aperture(**{name: value})


def test_pictures_are_told_apart_by_what_they_show() -> None:
    assert Aperture(image=heart()) == Aperture(image=heart())
    other = ApertureImage(heart().light[::-1].copy())
    assert Aperture(image=heart()) != Aperture(image=other)
