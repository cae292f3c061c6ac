"""The clip's noise in frames that are drawn: given back where the blur took it, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import DRAFT
from addon.core.media.light import encode_srgb
from addon.core.media.picture_file import Pixels
from addon.render.views.average import render_frame

from ..scenes import slanted_plane

SIZE = (320, 180)
CAMERA = Intrinsics(*SIZE, 280.0, 280.0, 160.0, 90.0)
NEAR, FAR = 8.0, 20.0
SIGMA = 5.0
"""Of 255, standard deviation of the clip's noise."""
LENS = FrameOptions(Focus(distance=NEAR), 0.6, borrow=False, highlights=HighlightSettings(gain=0.0))
"""Discs of 25 pixels at `FAR`."""
SHARP, SOFT = np.s_[10:-10, 10:154], np.s_[10:-10, 168:310]
"""Of the picture, on either side of the silhouette in its middle: what is in front of it is in focus."""


class HalfFar:
    """The left half near, the right half far."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        rows, columns = picture.shape[:2]
        inverse = np.where(np.arange(columns) < columns / 2, 1 / NEAR, 1 / FAR)
        return PixelDepth(np.tile(inverse, (rows, 1)), np.ones((rows, columns), np.float32))

    def kept(self, frame: int, canvas: Canvas) -> None:
        """Nothing: it need not be."""

    def samples(self, frame: int, canvas: Canvas) -> None:
        """Nothing: layers need none."""


def clip(sigma: float = SIGMA) -> ClipContext:
    """Grey that becomes lighter downwards, with noise."""

    def read(frame: int) -> Pixels:
        grey = np.linspace(60, 200, SIZE[1])[:, None, None]
        noise = np.random.default_rng(frame).standard_normal((SIZE[1], SIZE[0], 3))
        return np.clip(np.rint(grey + sigma * noise), 0, 255).astype(np.uint8)

    frames = tuple(range(1, 9))
    return ClipContext(slanted_plane(CAMERA, frames, near=5, far=22), read, HalfFar())


@pytest.fixture(scope="module")
def noisy() -> ClipContext:
    """A clip whose noise is measured once."""
    return clip()


def shown(context: ClipContext, lens: FrameOptions, frame: int = 4, size: tuple[int, int] = SIZE) -> Map:
    """(h, w, 3) a frame through a lens, of 255."""
    linear = render_frame(context, frame, lens, size, lambda note: None)[..., :3]
    return np.asarray(255 * encode_srgb(np.clip(linear, 0, 1)), np.float32)


@pytest.fixture(scope="module")
def pair(noisy: ClipContext) -> tuple[Map, Map]:
    """A frame without grain, and with it."""
    return shown(noisy, replace(LENS, grain=0.0)), shown(noisy, LENS)


def test_what_is_soft_is_as_noisy_as_the_clip(pair: tuple[Map, Map]) -> None:
    without, grained = pair
    rest = [each - each.mean(axis=(1, 2), keepdims=True) for each in (without[SOFT], grained[SOFT])]
    assert rest[0].std() < 0.1 * SIGMA
    assert abs(rest[1].std() / SIGMA - 1) < 0.05
    assert np.abs(rest[1].mean(axis=(0, 1))).max() < 0.2


def test_what_is_sharp_stays_as_it_is(pair: tuple[Map, Map]) -> None:
    np.testing.assert_array_equal(pair[0][SHARP], pair[1][SHARP])


def test_each_frame_has_noise_of_its_own_and_always_the_same(
    noisy: ClipContext, pair: tuple[Map, Map]
) -> None:
    added = (pair[1] - pair[0])[SOFT]
    np.testing.assert_array_equal(shown(noisy, LENS), pair[1])
    other = (shown(noisy, LENS, 5) - shown(noisy, replace(LENS, grain=0.0), 5))[SOFT]
    assert abs(np.corrcoef(added.ravel(), other.ravel())[0, 1]) < 0.02


def test_a_flat_sky_over_a_changing_street_gets_no_noise() -> None:
    """The street is another one in every frame, the sky has no noise."""

    def read(frame: int) -> Pixels:
        random = np.random.default_rng(frame)
        grey = np.full(SIZE[::-1], 20, np.uint8)
        street = random.integers(60, 190, (16, 54), dtype=np.uint8)
        grey[SIZE[1] // 2 :] = cv2.resize(street, (SIZE[0], SIZE[1] // 2), interpolation=cv2.INTER_CUBIC)
        return np.repeat(grey[..., None], 3, axis=2)

    night = replace(clip(), read=read)
    added = shown(night, LENS) - shown(night, replace(LENS, grain=0.0))
    np.testing.assert_array_equal(added[: SIZE[1] // 2 - 30], 0)


def test_a_smaller_draft_has_it_too(noisy: ClipContext) -> None:
    lens = replace(LENS, quality=replace(DRAFT, longest=SIZE[0] // 2))
    added = shown(noisy, lens) - shown(noisy, replace(lens, grain=0.0))
    assert abs(added[SOFT].std() / SIGMA - 1) < 0.05
    np.testing.assert_array_equal(added[SHARP], 0)
