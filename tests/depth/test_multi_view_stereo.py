"""Dense depth of three textured planes before a moving camera, whose depth is known at every pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.multi_view_stereo import DenseDepth, PlaneSweepStereo
from addon.core.depth.view_selection import parallaxes, select_source_views
from addon.core.media.light import decode_srgb, encode_srgb

from .. import planes
from ..planes import CENTRES, HEIGHT, LENS, MIDDLE, RANGE, WIDTH, clip, features, poses, truth

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]

HALF_LEVEL = 0.02
"""Of the range. The far plane's texture is finer than the pixels, so its place is uncertain."""


def dense(reconstruction: Reconstruction, pictures: Sequence[Picture], frame: int = MIDDLE) -> DenseDepth:
    result = PlaneSweepStereo(reconstruction, lambda number: pictures[number - 1]).at(frame)
    shape = (result.pinhole.height, result.pinhole.width)
    assert result.inverse_depth.shape == result.confidence.shape == result.moving.shape == shape
    assert np.all(np.isfinite(result.inverse_depth)) and np.all(result.inverse_depth >= 0)
    assert np.all((result.confidence >= 0) & (result.confidence <= 1))
    return result


def error(result: DenseDepth, true: Floats) -> Floats:
    """(h, w) share of the range of inverse depths."""
    return np.asarray(np.abs(result.inverse_depth - true) / RANGE)


@pytest.fixture(scope="module")
def pictures() -> list[Picture]:
    return clip(CENTRES)


@pytest.fixture(scope="module")
def found(pictures: list[Picture]) -> DenseDepth:
    return dense(poses(CENTRES, features()), pictures)


def test_depth_is_that_of_the_planes(found: DenseDepth) -> None:
    off = error(found, truth(CENTRES[MIDDLE - 1]))
    assert np.median(off) < HALF_LEVEL
    assert np.mean(off > 0.05) < 0.03
    right = found.confidence[off < 0.05]
    assert right.mean() > 2 * found.confidence[off > 0.05].mean()
    assert found.moving.mean() < 0.001


def test_silhouettes_lie_where_the_picture_has_them(found: DenseDepth) -> None:
    """Left and right edges of the nearest plane, row by row."""
    near = found.inverse_depth > (1 / 4 + 1 / 6) / 2
    left, right = WIDTH / 2 + planes.FOCAL * np.array(planes.PLANES[4.0]) / 4
    rows = slice(10, HEIGHT - 10)
    first = near[rows].argmax(axis=1)
    last = WIDTH - near[rows, ::-1].argmax(axis=1)
    assert np.median(np.abs(first - left)) <= 1 and np.median(np.abs(last - right)) <= 1
    assert np.mean(np.abs(first - left) > 3) < 0.1 and np.mean(np.abs(last - right) > 3) < 0.1


def test_bars_of_a_few_pixels_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Textured ones of 3, 4 and 6 pixels before a plane."""
    thin, apart = [round(width * 4 / planes.FOCAL * planes.TEXELS) for width in (3, 4, 6)], 0.8
    bars = {4 + 0.01 * n: (apart * (n - 1), apart * (n - 1) + w / planes.TEXELS) for n, w in enumerate(thin)}
    monkeypatch.setattr(planes, "PLANES", {10.0: (-30.0, 30.0), **bars})
    pictures = clip(CENTRES)
    near = dense(poses(CENTRES), pictures).inverse_depth > (1 / 4 + 1 / 10) / 2
    for depth, edges in bars.items():
        column = int(WIDTH / 2 + planes.FOCAL * np.mean(edges) / depth)
        shown = near[10:-10, column - 1 : column + 2]
        assert np.mean(shown.any(axis=1)) > 0.95
        # Nothing far around them is taken for them.
        around = near[10:-10, column - 15 : column + 16]
        assert np.median(around.sum(axis=1)) < planes.FOCAL * np.ptp(edges) / depth + 4


def test_the_scale_of_the_world_means_nothing(pictures: list[Picture], found: DenseDepth) -> None:
    for scale in (1e-3, 1e3):
        scaled = dense(poses(scale * CENTRES, scale * features()), pictures)
        off = np.abs(scaled.inverse_depth * scale - found.inverse_depth) / RANGE
        assert np.percentile(off, 99) < 1e-3
        assert np.percentile(np.abs(scaled.confidence - found.confidence), 99) < 1e-3


def test_exposure_and_white_balance_may_change(pictures: list[Picture]) -> None:
    def darker(picture: Picture) -> Picture:
        light = decode_srgb(picture / 255) * [0.75, 0.6, 0.5]
        return np.rint(255 * encode_srgb(light)).astype(np.uint8)

    changed = [p if i % 2 else darker(p) for i, p in enumerate(pictures)]
    off = error(dense(poses(CENTRES, features()), changed), truth(CENTRES[MIDDLE - 1]))
    assert np.median(off) < HALF_LEVEL and np.mean(off > 0.05) < 0.05


def test_distortion_is_taken_out(pictures: list[Picture]) -> None:
    lens = replace(LENS, k1=-0.1)
    grid = np.stack(np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5), axis=-1)
    at = (lens.pinhole_pixels(grid) - 0.5).astype(np.float32)
    bent = [cv2.remap(p, at, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT) for p in pictures]
    result = dense(poses(CENTRES, features(), lens), bent)
    assert result.pinhole == Canvas(lens).pinhole
    off = error(result, truth(CENTRES[MIDDLE - 1], result.pinhole))
    # The mirrored margin that the remapping made is no part of the scene.
    inner = off[20:-20, 20:-20]
    assert np.median(inner) < HALF_LEVEL and np.mean(inner > 0.05) < 0.05


@pytest.mark.parametrize("kind", ("as stored", "16 bits", "linear"))
def test_every_kind_of_picture_is_read(pictures: list[Picture], found: DenseDepth, kind: str) -> None:
    def read(frame: int) -> NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]:
        picture = pictures[frame - 1]
        if kind == "16 bits":
            return picture.astype(np.uint16) * 257
        if kind == "linear":
            return ((picture / 255) ** 2.2).astype(np.float32)
        return np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])

    result = PlaneSweepStereo(poses(CENTRES, features()), read).at(MIDDLE)
    assert np.percentile(np.abs(result.inverse_depth - found.inverse_depth), 90) < 0.02 * RANGE


def test_a_camera_that_only_turns_is_sure_of_nothing() -> None:
    still = np.zeros((5, 3))
    result = dense(poses(still, features()), clip(still), frame=3)
    assert not result.confidence.any() and not result.moving.any()
    # Depth comes from the points alone: it stays within theirs.
    assert np.all((result.inverse_depth > 0.09) & (result.inverse_depth < 0.26))


@pytest.mark.parametrize("points", (None, features()))
def test_nothing_is_seen_in_an_even_wall(points: Floats | None) -> None:
    even = [np.full((HEIGHT, WIDTH, 3), 90, np.uint8)] * len(CENTRES)
    result = dense(poses(CENTRES, points), even)
    assert result.confidence.mean() < 0.3 and not result.moving.any()


def test_walking_straight_ahead(found: DenseDepth) -> None:
    centres = np.column_stack([np.zeros(9), np.zeros(9), np.linspace(-0.8, 0.8, 9)])
    off = error(dense(poses(centres, features()), clip(centres)), truth(centres[MIDDLE - 1]))
    assert np.median(off) < 0.05


def falling(pictures: Sequence[Picture], before: float) -> tuple[list[Picture], list[Mask]]:
    """The clip with a square that falls, hiding what is of smaller inverse depth, and where it is seen."""
    pattern = planes.texture(48, 48, seed=7)[..., None]
    filmed, masks = [], []
    for number, (picture, centre) in enumerate(zip(pictures, CENTRES, strict=True), start=1):
        top = 90 + 4 * (number - MIDDLE)
        changed, mask = picture.copy(), np.zeros((HEIGHT, WIDTH), bool)
        mask[top : top + 48, 130:178] = True
        mask &= truth(centre) < before
        whole = np.zeros_like(picture)
        whole[top : top + 48, 130:178] = pattern
        changed[mask] = whole[mask]
        filmed.append(changed)
        masks.append(mask)
    return filmed, masks


def test_a_mask_tells_what_moves(pictures: list[Picture]) -> None:
    """Something that keeps to its place in the picture, which flow cannot tell from the middle plane."""
    filmed, masks = falling(pictures, before=1 / 8)
    shot = poses(CENTRES, features())
    large = {frame: np.repeat(np.repeat(mask, 2, axis=0), 2, axis=1) for frame, mask in enumerate(masks, 1)}
    masked = PlaneSweepStereo(shot, lambda n: filmed[n - 1], mask=large.get).at(MIDDLE)
    mask = masks[MIDDLE - 1]
    assert masked.moving[mask].all()
    assert np.mean(masked.moving & ~mask) < 0.01
    off = error(masked, truth(CENTRES[MIDDLE - 1]))
    assert np.median(off[~mask]) < HALF_LEVEL
    assert not masked.confidence[mask].any()
    # What is masked in the neighbours has no part in the depth of what stands still here.
    plain = PlaneSweepStereo(shot, lambda n: pictures[n - 1]).at(MIDDLE)
    around = cv2.dilate(mask.astype(np.uint8), np.ones((31, 31))) > 0
    assert np.mean(np.abs(masked.inverse_depth - plain.inverse_depth)[around & ~mask] > 0.1 * RANGE) < 0.05


def test_neighbours_are_chosen_by_baseline_and_not_by_count() -> None:
    """Four times the frames on the same way: the same distances."""
    chosen = []
    for count in (9, 33):
        steps = np.linspace(-0.4, 0.4, count)
        images = poses(np.column_stack([steps, 0 * steps, 0 * steps])).images
        own = images[count // 2]
        seen = parallaxes(own, LENS, ((i, LENS) for i in images), (0.1, 0.25))
        near = select_source_views(own, seen, (12.0, 4.0))
        chosen.append(sorted(round(one.image.centre[0], 1) for one in near))
        assert sorted(one.side for one in near) == [-1, -1, 1, 1]
    assert chosen[0] == chosen[1] == [-0.3, -0.1, 0.1, 0.3]
