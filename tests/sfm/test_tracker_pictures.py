"""What a tracker sees, as it comes to who waits."""

from __future__ import annotations

import numpy as np

from addon.core.media.light import encode_srgb
from addon.core.sfm.steps import MOST, WIDTH, sight_of


def test_a_frame_and_its_features_come_as_they_are() -> None:
    # Linear light, whose encoded values go evenly from left to right.
    ramp = np.tile(np.linspace(0, 1, 1920, dtype=np.float32)[None, :, None], (1080, 1, 4))
    linear = np.where(ramp <= 0.04045, ramp / 12.92, ((ramp + 0.055) / 1.055) ** 2.4).astype(np.float32)
    assert np.allclose(encode_srgb(linear), ramp, atol=1e-3)
    rng = np.random.default_rng(0)
    places = rng.random((2000, 2))
    sight = sight_of(linear, places)
    assert sight.picture.shape == (WIDTH * 1080 // 1920, WIDTH, 3)
    assert np.allclose(sight.picture / 255, np.linspace(0, 1, WIDTH)[None, :, None], atol=0.03)
    assert MOST / 2 < len(sight.places) <= MOST
    away = np.abs(sight.places[:, None] - places[None]).max(axis=2).min(axis=1)
    assert away.max() < 1e-4, "each is one of those that were found"


def test_no_features_and_small_frames_are_told() -> None:
    sight = sight_of(np.full((90, 160, 3), 200, np.uint8), np.zeros((0, 2)))
    assert sight.picture.shape == (90, 160, 3) and sight.places.shape == (0, 2)
