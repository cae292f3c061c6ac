"""Draft, normal and final: what each is drawn from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGBA
from addon.core.base.store import Store
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.source import PixelDepth
from addon.core.depth.stored_depth import depth_entry
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.detail import enlarged, enlarged_values
from addon.core.frame.frame import Frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import DRAFT, FINAL, NORMAL, QUALITIES, Quality
from addon.core.media.light import to_linear
from addon.render.views.average import render_frame

from ..scenes import psnr, slanted_plane, texture

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
SIZE = (160, 90)
FOCUS, BEHIND = 8.0, 40.0
PICTURE = texture(*SIZE)
SOURCE = to_linear(PICTURE)
LEFT, RIGHT = np.s_[:, 8:64], np.s_[:, 96:152]


@dataclass
class HalfInFocus:
    """The left half in focus, the right half far behind it."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        height, width = picture.shape[:2]
        inverse = np.where(np.arange(width) < width / 2, 1 / FOCUS, 1 / BEHIND)
        return PixelDepth(np.tile(inverse, (height, 1)), np.ones((height, width), np.float32))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def clip() -> ClipContext:
    return ClipContext(slanted_plane(LENS, near=5.0, far=12.0), lambda frame: PICTURE, HalfInFocus())


def lens(quality: Quality, views: int = 0) -> FrameOptions:
    return FrameOptions(Focus(distance=FOCUS), 0.7, views, borrow=False, quality=quality)


def rendered(quality: Quality) -> tuple[NDArray[np.float32], Frame]:
    drawn: list[Frame] = []
    picture = render_frame(clip(), 2, lens(quality), SIZE, lambda note: None, drawn.append)
    return picture, drawn[0]


def test_a_draft_of_a_large_picture_is_sharp_in_focus_and_blurred_as_normal_elsewhere() -> None:
    normal, whole = rendered(NORMAL)
    draft, small = rendered(replace(DRAFT, longest=SIZE[0] // 2))
    assert draft.shape == normal.shape == (90, 160, 4)
    assert small.small.shape == (45, 80, 4) and whole.small.shape == (90, 160, 4)
    assert len(small.views.offsets) < len(whole.views.offsets)
    halved = cv2.resize(cv2.resize(SOURCE, (80, 45), interpolation=cv2.INTER_AREA), SIZE)
    # Without the sharpness that is added it could not be better than a picture that was small.
    assert psnr(draft[LEFT], SOURCE[LEFT]) > psnr(halved[LEFT], SOURCE[LEFT]) + 15
    assert psnr(draft[RIGHT], normal[RIGHT]) > psnr(draft[RIGHT], SOURCE[RIGHT]) + 15


def test_sharpness_is_added_where_it_is_kept_and_nowhere_else() -> None:
    rng = np.random.default_rng(0)
    source = rng.random((31, 41, 4)).astype(np.float32)
    small = cv2.resize(source, (21, 16), interpolation=cv2.INTER_AREA)
    soft = enlarged(small, small, source, None)
    np.testing.assert_array_equal(enlarged(small, small, source, np.zeros((16, 21, 3), np.float32)), soft)
    np.testing.assert_allclose(
        enlarged(small, small, source, np.ones((16, 21, 3), np.float32)), source, atol=1e-6
    )
    assert soft.min() >= 0 and soft[..., 3].max() <= 1 and psnr(soft, source) < 20


def test_detail_stays_between_the_pictures_beside_a_silhouette() -> None:
    # A sharp dark subject before a light that is blurred away: half of the small pixel at the edge is light.
    source = np.full((8, 8, 4), [0.05, 0.05, 0.05, 1.0], np.float32)
    source[:, 5:] = 0.9, 0.9, 0.9, 1.0
    small = cv2.resize(source, (4, 4), interpolation=cv2.INTER_AREA)
    blurred = np.full_like(small, [0.06, 0.06, 0.06, 1.0])
    picture = enlarged(blurred, small, source, np.ones((4, 4, 3), np.float32))
    assert picture.min() >= 0.05 - 1e-6


def test_passes_of_smaller_frames_are_enlarged_along_the_edges_of_the_picture() -> None:
    random = np.random.default_rng(5)
    bright = random.random((90, 160, 1), np.float32) > 0.999
    near = cv2.GaussianBlur(bright.astype(np.float32), (0, 0), 6) > 0.0003
    source = np.repeat(np.where(near[..., None], 0.8, 0.1), 4, axis=2).astype(np.float32)
    small = cv2.resize(source, (80, 45), interpolation=cv2.INTER_AREA)
    depth = np.where(small[..., 0] > 0.45, 2.0, 9.0).astype(np.float32)
    truth = np.where(near, 2.0, 9.0)
    wrong = np.count_nonzero(enlarged_values(depth, small, source) != truth)
    nearest = cv2.resize(depth, (160, 90), interpolation=cv2.INTER_NEAREST)
    assert wrong < 0.25 * np.count_nonzero(nearest != truth)
    assert set(np.unique(enlarged_values(depth, small, source))) == {2.0, 9.0}


@pytest.mark.parametrize("quality", QUALITIES.values(), ids=QUALITIES)
def test_a_draft_takes_depth_that_is_kept_of_normal_and_nothing_else_does(
    quality: Quality, tmp_path: Path
) -> None:
    bare = ClipContext(slanted_plane(LENS), lambda frame: PICTURE)
    frame, canvas = 2, Canvas(LENS)
    pinhole = bare.stereo.at(frame).pinhole
    shape = pinhole.height, pinhole.width
    strange = np.full(shape, 0.5, np.float32)
    strange[0] = 0.25
    found = DenseDepth(frame, strange, np.ones(shape, np.float32), np.zeros(shape, bool), pinhole)
    stores = {each.name: Store(tmp_path, lambda each=each: each.name) for each in QUALITIES.values()}  # type: ignore[misc]
    stores["normal"].get(depth_entry("depth", frame, pinhole), lambda: found)
    kept = ClipContext(bare.reconstruction, bare.read, store=lambda quality: stores[quality.name]).depth(
        frame, canvas, SOURCE, quality
    )
    is_kept = bool(np.isclose(np.median(kept.inverse_depth), 0.5, atol=1e-3))
    assert is_kept == (quality is not FINAL)


def test_large_frames_are_drawn_smaller() -> None:
    assert NORMAL.drawn_size((960, 540)) == (960, 540)
    assert NORMAL.drawn_size((1280, 720)) == (640, 360)
    assert NORMAL.drawn_size((2160, 3840)) == (540, 960)
    assert DRAFT.drawn_size((3840, 2160)) == (960, 540)
    assert DRAFT.drawn_size((960, 540)) == (960, 540)
    assert FINAL.drawn_size((7680, 4320)) == (3840, 2160)
    # The source has no detail for CG objects.
    assert NORMAL.drawn_size((3840, 2160), has_cg=True) == (3840, 2160)
    assert DRAFT.drawn_size((3840, 2160), has_cg=True) == (960, 540)
