"""Noise that is measured in clips of known noise, and made anew."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, Map
from addon.core.media.noise import AXES, Noise, measured

SIZE = (320, 240)
FRAMES = tuple(range(1, 13))
STRENGTH = 4.0
"""Of 255, standard deviation of red, green and blue."""

type Read = Callable[[int], NDArray[np.uint8]]


def shades(frame: int) -> Map:
    """(h, w, 3) soft shades of all levels, without noise."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    grey = 20 + 210 * (columns + 0.2 * rows) / (SIZE[0] + 0.2 * SIZE[1])
    return np.asarray(np.repeat(grey[..., None], 3, axis=2), np.float32)


def leaves(frame: int) -> Map:
    """(h, w, 3) fine texture everywhere, 1.5 pixels farther in each frame."""
    random = np.random.default_rng(2).random((200, 400), np.float32)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    grey = cv2.remap(random, (columns + 1.5 * frame) / 2, rows / 2, cv2.INTER_CUBIC)
    return np.asarray(np.repeat(60 + 120 * grey[..., None], 3, axis=2), np.float32)


def white(frame: int) -> Map:
    """(h, w, 3) white noise of the variance 1."""
    return np.random.default_rng(frame).standard_normal((SIZE[1], SIZE[0], 3), np.float32)


def blurred(frame: int) -> Map:
    """(h, w, 3) noise over three pixels, of the variance 1."""
    noise = cv2.GaussianBlur(white(frame), (0, 0), 1.0)
    return np.asarray(noise / noise.std(axis=(0, 1)), np.float32)


def clip(shown: Callable[[int], Map], noise: Callable[[int], Map], strength: float | Map) -> Read:
    """A clip that shows something with noise of a strength, of 255."""
    return lambda frame: np.clip(np.rint(shown(frame) + strength * noise(frame)), 0, 255).astype(np.uint8)


def found(read: Read) -> Noise:
    noise = measured(read, FRAMES)
    assert noise is not None
    return noise


@cache
def noise_like(noise: Callable[[int], Map]) -> Noise:
    """What is measured of shades with noise of `STRENGTH`."""
    return found(clip(shades, noise, STRENGTH))


def spread(picture: Map) -> Floats:
    """(3,) correlation of a picture (h, w, 3) with itself a pixel further."""
    rest = picture - picture.mean(axis=(0, 1))
    return np.asarray((rest[:, 1:] * rest[:, :-1]).mean(axis=(0, 1)) / rest.var(axis=(0, 1)))


@pytest.mark.parametrize("noise", [white, blurred])
def test_its_strength_and_its_spectrum_are_found(noise: Callable[[int], Map]) -> None:
    measured_noise = noise_like(noise)
    # Of the flattest blocks: a little less than there is on average, never more.
    assert 0.9 < 255 * measured_noise.strength / STRENGTH < 1.02
    anew = 255 * measured_noise.components(SIZE, 1) @ AXES.T
    assert np.abs(anew.std(axis=(0, 1)) / (255 * measured_noise.strength) - 1).max() < 0.04
    assert np.abs(spread(anew) - spread(noise(1))).max() < 0.06


def test_a_picture_gets_no_more_than_it_shows() -> None:
    """Left is all of the noise, right a quarter of it, and below nothing."""
    shown = np.full((SIZE[1], SIZE[0], 3), 0.4, np.float32)
    left, middle = np.s_[:, : SIZE[0] // 2], np.s_[: SIZE[1] // 2, SIZE[0] // 2 :]
    noise, fine = noise_like(white), white(1) * np.float32(STRENGTH / 255)
    shown[left] += fine[left]
    shown[middle] += fine[middle] / 4
    share = noise.share(shown)
    assert share[20:-20, 20:140].mean() > 0.95
    assert abs(share[20:100, 180:-20].mean() - 0.25) < 0.03
    assert share[140:-20, 180:-20].max() == 0


def test_a_flat_place_beside_strong_texture_gets_a_number() -> None:
    """Sums of squares along a row, added and taken away again, become negative there."""
    shown = np.full((SIZE[1], SIZE[0], 3), 0.5, np.float32)
    shown[60:180, 60:180] = np.random.default_rng(1).random((120, 120, 1), np.float32)
    share = noise_like(white).share(shown)
    assert np.isfinite(share).all()
    assert share[:, 200:].max() < 1e-6


def test_flickering_lamps_and_texture_that_flow_does_not_find_are_no_noise() -> None:
    """The flat sky has noise of 0.5 of 255, carried from frame to frame as codecs do; the street below is
    another one in every frame."""

    def night(frame: int) -> Map:
        random = np.random.default_rng(frame)
        grey = 20 + 0.5 * white(1)[..., 0]
        grey[-120:] = cv2.resize(40 + 80 * random.random((40, 54), np.float32), (SIZE[0], 120))
        for x, y in np.random.default_rng(0).integers((0, 40), (SIZE[0], 120), (12, 2)):
            cv2.circle(grey, (int(x), int(y)), 2, float(random.uniform(100, 255)), -1)
        return np.repeat(grey[..., None], 3, axis=2)

    noise = measured(clip(night, white, 0.0), FRAMES)
    assert noise is None or not noise.is_visible


def test_noise_is_told_from_texture_by_what_moves() -> None:
    """All of the picture is texture, ten times as strong as the noise that is added to a part of it."""
    nothing = measured(clip(leaves, white, 0.0), FRAMES)
    assert nothing is None or not nothing.is_visible

    def half(frame: int) -> Map:
        shown = leaves(frame)
        shown[:, SIZE[0] // 2 :] = 120
        return shown

    noise = found(clip(half, white, STRENGTH))
    assert abs(255 * noise.strength / STRENGTH - 1) < 0.06


def test_what_a_disc_leaves() -> None:
    """Of white noise the root of one over the disc's pixels; of coarse noise more."""
    fine, coarse = (noise_like(noise) for noise in (white, blurred))
    left = fine.left(np.array([0, 4.0, 8.0], np.float32))
    np.testing.assert_array_equal(left[0], 1)
    for row, diameter in zip(left[1:], (4, 8), strict=True):
        assert np.abs(row * diameter * np.sqrt(np.pi / 4) - 1).max() < 0.1
    assert (coarse.left(np.array([4.0], np.float32)) > 1.5 * left[1]).all()
