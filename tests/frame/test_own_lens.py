"""The depth of field that a clip has already: measured at its edges, and taken off what a lens is to add."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map
from addon.core.base.store import Store
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.frame.clip_context import no_picture
from addon.core.frame.own_lens import OwnLens, edge_variances, own_lens
from addon.core.media.light import encode_srgb
from addon.core.media.picture_file import Pixels
from addon.core.optics.thin_lens import ThinLens

SIZE = (320, 192)
LENS = Intrinsics(*SIZE, 300.0, 300.0, 160.0, 96.0)
FRAMES = 9
STRIPS = 6
FINE = 4


def disc(diameter: float) -> Map:
    """(n, n) kernel of a disc of a diameter in pixels, sum 1."""
    reach = int(np.ceil(diameter / 2)) + 1
    at = (np.arange(FINE * (2 * reach + 1)) + 0.5) / FINE - reach - 0.5
    inside = (np.hypot(at[:, None], at) <= diameter / 2).astype(np.float32)
    cells = inside.reshape(2 * reach + 1, FINE, 2 * reach + 1, FINE).mean(axis=(1, 3))
    return np.asarray(cells / cells.sum(), np.float32)


def squares(seed: int) -> Map:
    """(H, W) linear light of many sharp corners."""
    rng = np.random.default_rng(seed)
    coarse = rng.choice([0.1, 0.25, 0.6], (SIZE[1] // 12, SIZE[0] // 12 + 1)).astype(np.float32)
    grown = cv2.resize(coarse, (12 * coarse.shape[1], SIZE[1]), interpolation=cv2.INTER_NEAREST)
    return cv2.GaussianBlur(grown[:, : SIZE[0]], (0, 0), 0.4)


def filmed(diameter: Callable[[float, int], float]) -> tuple[Reconstruction, Callable[[int], Pixels]]:
    """A clip of strips that lie one behind the other, each with corners, blurred by a disc of a diameter in
    pixels for an inverse depth and a frame."""
    inverse = np.linspace(0.05, 0.3, STRIPS)
    pictures: dict[int, Pixels] = {}
    wide = SIZE[0] // STRIPS
    for frame in range(1, FRAMES + 1):
        light, whole = squares(frame), np.zeros((SIZE[1], SIZE[0]), np.float32)
        for strip, each in enumerate(inverse):
            size = diameter(float(each), frame)
            part = cv2.filter2D(light, -1, disc(size)) if size > 0.1 else light
            whole[:, strip * wide : (strip + 1) * wide] = part[:, strip * wide : (strip + 1) * wide]
        noise = np.random.default_rng(frame).normal(0, 0.7, whole.shape)
        shown = np.clip(255 * encode_srgb(whole) + noise, 0, 255).astype(np.uint8)
        pictures[frame] = np.dstack([shown] * 3)
    corner = np.stack(np.meshgrid(np.arange(12, SIZE[0] - 12, 12), np.arange(12, SIZE[1] - 12, 12)), -1)
    xy = corner.reshape(-1, 2).astype(np.float64)
    inner = (xy[:, 0] % wide > 10) & (xy[:, 0] % wide < wide - 10) & (xy[:, 0] < wide * STRIPS)
    xy = xy[inner]
    depth = 1 / inverse[(xy[:, 0] // wide).astype(int)]
    xyz = np.column_stack([(xy - LENS.principal_point) / LENS.focal, np.ones(len(xy))]) * depth[:, None]
    ids = np.arange(len(xy), dtype=np.int32)
    images = tuple(Image(frame, np.eye(3), np.zeros(3), xy, ids) for frame in pictures)
    points = Points(xyz, np.zeros((len(xy), 3), np.uint8), np.zeros(len(xy)))
    return Reconstruction((LENS,), images, points), pictures.__getitem__


@pytest.mark.parametrize("diameter", [3.0, 5.0, 8.0])
def test_the_blur_of_an_edge_is_measured(diameter: float) -> None:
    sharp, blurred = squares(1), cv2.filter2D(squares(1), -1, disc(diameter))

    def variance(light: Map) -> float:
        steepness, found = edge_variances(light)
        return float(np.median(found[steepness > 0.02]))

    added = variance(np.asarray(blurred, np.float32)) - variance(sharp)
    assert 4 * np.sqrt(added) == pytest.approx(diameter, rel=0.25)


def test_a_lens_is_found_by_where_it_is_sharp_and_how_much_it_blurs() -> None:
    radius, focus = 0.08, 0.15
    found = own_lens(*filmed(lambda inverse, frame: 2 * radius * LENS.fx * abs(inverse - focus)))
    assert found is not None
    assert found.radius == pytest.approx(radius, rel=0.25)
    assert found.focus_at(5) == pytest.approx(focus, abs=0.03)


def test_focus_that_is_pulled_is_followed() -> None:
    def focus(frame: int) -> float:
        return 0.1 + 0.15 * (frame - 1) / (FRAMES - 1)

    found = own_lens(*filmed(lambda inverse, frame: 2 * 0.1 * LENS.fx * abs(inverse - focus(frame))))
    assert found is not None
    assert found.focus_at(1) == pytest.approx(focus(1), abs=0.04)
    assert found.focus_at(FRAMES) == pytest.approx(focus(FRAMES), abs=0.04)


def test_a_clip_that_is_all_sharp_or_all_soft_has_none() -> None:
    assert own_lens(*filmed(lambda inverse, frame: 0.0)) is None
    assert own_lens(*filmed(lambda inverse, frame: 4.0)) is None


def test_a_kept_lens_is_read_without_a_frame(tmp_path: Path) -> None:
    clip, read = filmed(lambda inverse, frame: 2 * 0.08 * LENS.fx * abs(inverse - 0.15))
    first = own_lens(clip, read, Store(tmp_path, lambda: "key"))
    assert first is not None
    assert own_lens(clip, no_picture, Store(tmp_path, lambda: "key")) == first

    sharp, read = filmed(lambda inverse, frame: 0.0)
    assert own_lens(sharp, read, Store(tmp_path, lambda: "sharp")) is None
    assert own_lens(sharp, no_picture, Store(tmp_path, lambda: "sharp")) is None


def test_photos_have_no_lens_in_common() -> None:
    clip, read = filmed(lambda inverse, frame: 2 * 0.08 * LENS.fx * abs(inverse - 0.15))
    assert own_lens(replace(clip, is_ordered=False), read) is None


def test_a_lens_as_wide_as_the_clips_own_is_no_exception() -> None:
    lens, own = ThinLens(LENS, 0.1, 0.15), OwnLens(0.1, (0.2, 0.2), (1, 9))
    inverse: Floats = np.linspace(0.02, 0.5, 50)
    assert np.isfinite(own.true(4, lens, own.missing(4, lens, inverse))).all()


@pytest.mark.parametrize("focus", [0.15, 0.2])
def test_both_blurs_together_are_the_wished_one(focus: float) -> None:
    lens, own = ThinLens(LENS, 0.2, 0.15), OwnLens(0.1, (focus, focus), (1, 9))
    inverse: Floats = np.linspace(0.02, 0.5, 400)
    wished = lens.blur_disc(inverse)
    already = 2 * own.radius * LENS.fx * (inverse - focus)
    added = lens.blur_disc(own.missing(4, lens, inverse))
    less = np.abs(wished) > np.abs(already)
    assert np.allclose(added[less] ** 2 + already[less] ** 2, wished[less] ** 2)
    assert np.all(added[~less] == 0)
    more = np.abs(already) > np.abs(wished) + lens.acceptable_disc
    assert own.share_softer(4, lens, inverse) == pytest.approx(more.mean())
    # What is nearer stays nearer, and where it is can be told from it.
    assert np.all(np.diff(added) >= 0)
    assert np.allclose(own.true(4, lens, own.missing(4, lens, inverse[less])), inverse[less])
