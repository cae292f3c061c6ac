"""Small lights at night, each of which has one depth."""

from __future__ import annotations

import cv2
import numpy as np

from addon.core.depth.light_spots import RIM, with_lights

SIZE = (240, 400)
LIGHTS = ((60, 80), (120, 200), (180, 320))
"""Rows and columns."""


def night() -> np.ndarray:
    """(h, w, 3) lights of different sizes on black."""
    picture = np.full((*SIZE, 3), 8, np.uint8)
    for radius, (row, column) in enumerate(LIGHTS):
        cv2.circle(picture, (column, row), radius, (255, 240, 220), -1)
    return cv2.GaussianBlur(picture, (0, 0), 0.6)


def test_a_light_has_the_depth_of_its_brightest_pixel() -> None:
    leaning = np.linspace(0.1, 0.9, SIZE[1], dtype=np.float32) * np.ones((SIZE[0], 1), np.float32)
    found = with_lights(night(), leaning)
    for row, column in LIGHTS:
        own = found[row - RIM : row + RIM + 1, column - RIM : column + RIM + 1]
        assert np.ptp(own) == 0 and abs(own[0, 0] - leaning[row, column]) < 0.01
    assert np.array_equal(found[:, :60], leaning[:, :60])
    changed = (found != leaning).mean()
    assert 0.0005 < changed < 0.005


def test_pixels_of_subjects_and_pictures_by_day_are_left_alone() -> None:
    leaning = np.linspace(0.1, 0.9, SIZE[1], dtype=np.float32) * np.ones((SIZE[0], 1), np.float32)
    moving = np.zeros(SIZE, bool)
    moving[:, :140] = True
    found = with_lights(night(), leaning, moving)
    assert np.array_equal(found[:, :140], leaning[:, :140]) and not np.array_equal(found, leaning)
    by_day = np.random.default_rng(1).integers(90, 160, (*SIZE, 3)).astype(np.uint8)
    assert np.array_equal(with_lights(by_day, leaning), leaning)
    # A window is no light.
    window = np.full((*SIZE, 3), 8, np.uint8)
    window[80:160, 120:240] = 255
    assert np.array_equal(with_lights(window, leaning), leaning)
