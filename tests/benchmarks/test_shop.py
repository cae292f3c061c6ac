"""The shop's light field as truth: it is reproduced from its own views by the product's geometry."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.camera.canvas import Canvas
from addon.core.media.light import encode_srgb, to_linear
from addon.core.optics.aperture_sampling import exact_registration
from benchmarks.accuracy import metrics
from benchmarks.accuracy.shop import FOCUS, MARGIN, Shop, _shifted

INNER = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
SKULL = np.s_[440:560, 700:830]
"""The skull's face, which is 5.2 to 5.5 m away."""


@pytest.fixture(scope="module")
def shop(data: Path) -> Shop:
    return Shop("shop5", data / "shop")


@pytest.fixture(scope="module")
def middle(shop: Shop) -> int:
    return shop.path.index((13, 13)) + 1


def detail(picture: np.ndarray) -> float:
    """Mean squared Laplacian of the skull, past the grain of JPEG."""
    gray = encode_srgb(np.clip(picture, 0, 1)).mean(axis=-1).astype(np.float64)
    return float((cv2.Laplacian(cv2.GaussianBlur(gray, (0, 0), 1.0)[SKULL], cv2.CV_64F) ** 2).mean())


def test_the_path_is_a_clip(shop: Shop) -> None:
    assert len(shop.path) >= 24
    steps = np.abs(np.diff(np.array(shop.path), axis=0))
    assert steps.max() <= 3
    assert len(set(shop.path)) == len(shop.path)
    assert len(shop.files) == 289


def test_the_discs_are_whole(shop: Shop, middle: int) -> None:
    for frame in (middle - 1, middle, middle + 1):
        # A disc of 4.06 spacings around a grid point holds 49 points, as in Gauss's circle problem.
        assert len(shop.disc(frame, 0.125)) == 49
    assert len(shop.disc(middle, 0.24)) == 185


def test_the_truth_is_the_mean_of_the_products_registered_views(shop: Shop, middle: int) -> None:
    """The product's registration, told the places of the shop's own views, gives the shop's truth."""
    views = shop.disc(middle, 0.125)
    offsets = np.array([shop.places[view] for view in views])
    np.testing.assert_allclose(shop.places[13, 13], 0, atol=1e-9)
    canvas = Canvas(shop.cameras.cameras[0])
    shifts = exact_registration(canvas, offsets, 1 / FOCUS[shop.name])[:, :, 2]
    pictures = [to_linear(cv2.imread(str(shop.files[view]))[..., ::-1])[..., :3] for view in views]
    mean = np.mean([_shifted(p, s) for p, s in zip(pictures, shifts, strict=True)], axis=0)
    truth = np.mean([shop.registered(middle, view, 5.0) for view in views], axis=0)
    assert metrics.psnr(mean[INNER], truth[INNER]) > 60


def test_only_this_sign_of_the_shifts_is_sharp(shop: Shop, middle: int) -> None:
    """In register the skull is about as sharp as in one view, with any other sign or depth it is not."""
    views = shop.disc(middle, 0.125)
    frame = to_linear(shop.frame(middle))[..., :3]
    pictures = [to_linear(cv2.imread(str(shop.files[view]))[..., ::-1])[..., :3] for view in views]

    def mean(signs: tuple[int, int], depth: float) -> np.ndarray:
        shifts = [np.array(signs) * shop.places[view] * 800 / depth for view in views]
        return np.mean([_shifted(p, s) for p, s in zip(pictures, shifts, strict=True)], axis=0)

    right = detail(mean((1, 1), 5.3))
    assert right > 0.85 * detail(frame)
    for signs, depth in (((1, -1), 5.3), ((-1, 1), 5.3), ((-1, -1), 5.3), ((1, 1), 4.6), ((1, 1), 6.0)):
        assert detail(mean(signs, depth)) < 0.5 * right, (signs, depth)


def test_the_sweep_finds_the_depth_that_refocusing_finds(shop: Shop, middle: int) -> None:
    assert np.median(shop.depth(middle)[SKULL]) == pytest.approx(5.3, rel=0.03)


def test_a_missing_light_field_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VA_DATA", str(tmp_path))
    found = Shop.open("shop5")
    assert isinstance(found, str)
    assert "VA_DATA" in found
