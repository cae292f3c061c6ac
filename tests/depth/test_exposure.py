"""Frames of a clip whose exposure and white balance drift are made alike before they are compared."""

from __future__ import annotations

import numpy as np

from addon.core.depth.plane_sweep import CLIPPED, exposed_as
from addon.core.media.light import decode_srgb, encode_srgb


def filmed(light: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8, as a camera writes light."""
    return np.rint(255 * encode_srgb(np.clip(light, 0, 1))).astype(np.uint8)


def test_light_times_a_factor_a_channel_is_undone() -> None:
    light = np.random.default_rng(1).uniform(0.02, 1.3, (40, 60, 3))
    own, theirs = filmed(light), filmed(light * [1.6, 1.4, 1.25])
    # A tenth of it is something else there.
    places = theirs.copy()
    places[:4] = 20
    found = exposed_as(theirs, own.reshape(-1, 3), places.reshape(-1, 3))
    clear = (theirs < 255).all(axis=2)
    assert np.abs(found.astype(int) - own)[clear].max() <= 2
    assert np.abs(found.astype(int) - own)[clear].mean() < 0.5


def test_what_is_alike_or_clipped_stays_as_it_is() -> None:
    picture = filmed(decode_srgb(np.random.default_rng(2).random((30, 40, 3))))
    places = picture.reshape(-1, 3)
    assert exposed_as(picture, places, places) is picture
    white = np.full((500, 3), CLIPPED, np.uint8)
    assert exposed_as(picture, white, white // 2) is picture
    assert exposed_as(picture, places[:0], places[:0]) is picture
