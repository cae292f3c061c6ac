"""Depth that is steady in time: what is fused of several frames, what is filled, and what is left alone."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, Map, Mask
from addon.core.base.store import NOT_KEPT, Store
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.map_fusion import (
    BORDER,
    LEVELS,
    FusionOptions,
    fused,
    sharpened,
    without_islands,
    without_speckles,
)
from addon.core.depth.multi_view_stereo import DenseDepth, PlaneSweepStereo
from addon.core.depth.temporal_fusion import TemporalFusion

from .. import planes
from ..planes import CENTRES, LENS, MIDDLE, RANGE, clip, features, poses, truth

OPTIONS = FusionOptions()
SHAPE = (LENS.height, LENS.width)
WALL, NEAR = 0.1, 0.4
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]


@dataclass
class Given:
    """Depth of single frames that was made by hand."""

    frames: dict[int, DenseDepth]
    grey: Map = field(default_factory=lambda: np.full(SHAPE, 120, np.float32))

    def at(self, frame: int) -> DenseDepth:
        return self.frames[frame]

    def moving(self, frame: int) -> Mask:
        return self.frames[frame].moving

    def prefetch(self, frames: list[int]) -> None: ...

    def pinhole(self, frame: int) -> Intrinsics:
        return LENS

    def picture(self, frame: int) -> NDArray[np.uint8]:
        return np.repeat(self.grey.astype(np.uint8)[..., None], 3, axis=2)


def depth(frame: int, inverse: object, confidence: object, moving: Mask | None = None) -> DenseDepth:
    nothing = np.zeros(SHAPE, bool)
    return DenseDepth(
        frame,
        np.broadcast_to(np.asarray(inverse, np.float32), SHAPE).copy(),
        np.broadcast_to(np.asarray(confidence, np.float32), SHAPE).copy(),
        nothing if moving is None else moving,
        LENS,
    )


def steady(made: list[DenseDepth], frame: int, grey: Map | None = None) -> DenseDepth:
    """Of cameras that all stand at one place."""
    still = poses(np.zeros((len(made), 3)))
    stereo = Given({one.frame: one for one in made})
    if grey is not None:
        stereo.grey = grey
    return TemporalFusion(still, stereo).at(frame)  # type: ignore[arg-type]


# Many frames


def test_one_wrong_frame_changes_nothing() -> None:
    inverse = np.full((5, *SHAPE), WALL, np.float32) + np.linspace(0, 0.2, SHAPE[1], dtype=np.float32)
    right = inverse[0].copy()
    inverse[3] += 0.5
    weight = np.full((5, *SHAPE), 0.9, np.float32)
    value, confidence, _ = fused(inverse, weight)
    np.testing.assert_allclose(value, right, atol=1e-6)
    assert confidence.min() > 0.8
    # Unless it is the only one that knows.
    weight[:] = 0
    weight[3] = 0.9
    np.testing.assert_allclose(fused(inverse, weight)[0], inverse[3], atol=1e-6)


def test_agreeing_frames_make_sure() -> None:
    means = []
    for agreeing in range(1, 6):
        inverse = np.full((5, *SHAPE), 2.0, np.float32) + 0.2 * (X > 100)
        # The others say something else each, nearer and farther.
        for n in range(agreeing, 5):
            inverse[n] += (-1) ** n * (0.3 + 0.3 * n)
        means.append(float(fused(inverse.astype(np.float32), np.full_like(inverse, 0.3))[1].mean()))
    assert np.all(np.diff(means) > 0)
    # Five frames that say five things know nothing.
    assert means[0] < 0.05


def test_who_sees_past_what_the_border_cuts_does_not_contradict_it() -> None:
    """A camera rises over a ledge: from the second frame on it is below the picture, and of the wall behind
    it ever more of what it hid is seen."""
    ledge, away = SHAPE[0] - 20, 24 / (LENS.fy * NEAR)
    rising = poses(np.outer(np.arange(4), [0, -away, 0]))
    frames = {
        n + 1: depth(n + 1, np.where(ledge + 24 * n <= Y, NEAR, WALL), 1.0) for n in range(len(rising.images))
    }
    seen = Given(frames, np.where(ledge <= Y, 60, 190).astype(np.float32))
    found = TemporalFusion(rising, seen).at(1).inverse_depth  # type: ignore[arg-type]
    np.testing.assert_allclose(found[ledge:, 10:-10], NEAR, atol=0.01)
    np.testing.assert_allclose(found[10 : ledge - 2, 10:-10], WALL, atol=0.01)


# One frame


def test_what_is_not_sure_beside_something_near_is_behind_it() -> None:
    near, unsure = (X > 120) & (X < 180), (X >= 180) & (X < 220)
    inverse = np.where(near, NEAR, WALL)
    inverse[unsure] = 0.7
    found = steady([depth(1, inverse, np.where(unsure, 0, 1))], 1).inverse_depth
    band = found[20:-20, 185:215]
    # Its middle is as far from the one as from the other, and nothing of its own depth is left.
    assert band[:, 15].max() < WALL + 0.1 * (NEAR - WALL)
    assert np.median(band) < WALL + 0.05 * (NEAR - WALL)
    np.testing.assert_allclose(found[20:-20, 130:170], NEAR, atol=0.02)


def test_a_hole_in_a_surface_is_filled_from_its_rim() -> None:
    """Where the picture's edge is faint, as at a wooden head before a wall that is surer."""
    away = np.hypot(X - 160, Y - 120)
    head, hole = away < 30, away < 1.2
    grey = np.where(head, 140 + 0.5 * np.abs(X - 160), 112).astype(np.float32)
    inverse = np.where(hole, 0.7, np.where(head, NEAR, WALL))
    confidence = np.where(hole, 0, np.where(head, 0.6, 1))
    found = steady([depth(1, inverse, confidence)], 1, grey).inverse_depth
    np.testing.assert_allclose(found[hole], NEAR, atol=0.02)
    np.testing.assert_allclose(found[(away > 40) & (away < 100)], WALL, atol=0.02)


def test_nothing_is_between_two_surfaces() -> None:
    """At a silhouette that is half sure."""
    away = np.hypot(X - 160, Y - 120)
    grey = np.where(away < 30, 124, 112).astype(np.float32)
    inverse = np.where(away < 30, NEAR, WALL)
    confidence = np.where((away > 26) & (away < 34), 0.3, 1)
    found = steady([depth(1, inverse, confidence)], 1, grey).inverse_depth
    off = np.minimum(np.abs(found - NEAR), np.abs(found - WALL))
    assert off[20:-20, 20:-20].max() < 0.02


def test_sure_depth_is_carried_up_to_the_edges_of_the_picture_only() -> None:
    """Two unsure surfaces that look different, each with something sure in it."""
    left = X < 160
    sure = (np.abs(X - 60) < 25) | (np.abs(X - 260) < 25)
    inverse, grey = np.where(left, 0.2, 0.1), np.where(left, 60, 190).astype(np.float32)
    wrong = np.where(sure, inverse, 0.5)
    found = steady([depth(1, wrong, np.where(sure, 1, 0))], 1, grey).inverse_depth
    inner = np.s_[20:-20, 20:-20]
    off = np.abs(found - inverse)[inner][:, np.abs(X[0, 20:-20] - 160) > 4]
    assert off.max() < 0.01


def test_islands_of_chance_go_and_small_things_stay() -> None:
    blob = (np.abs(X - 160) < 6) & (np.abs(Y - 120) < 6)
    inverse = np.where(blob, NEAR, WALL)
    # Amid what nobody is sure of: far from it is the wall.
    unsure = (np.abs(X - 160) < 80) & (np.abs(Y - 120) < 80) & ~blob
    found = steady([depth(1, inverse, np.where(unsure, 0, 1))], 1)
    assert found.confidence[blob].max() < 0.1
    np.testing.assert_allclose(found.inverse_depth[blob], WALL, atol=0.02)
    # With a rim that nobody is sure of, amid what everybody is.
    rim = (np.abs(X - 160) < 7) & (np.abs(Y - 120) < 7) & ~blob
    found = steady([depth(1, inverse, np.where(rim, 0, 1))], 1)
    assert found.confidence[blob].min() > 0.5
    np.testing.assert_allclose(found.inverse_depth[blob], NEAR, atol=0.02)


def test_what_moves_is_not_lent_to_other_frames() -> None:
    """Each frame's own moving pixels get one depth, here that of the wall around them."""
    moving = (np.abs(X - 160) < 30) & (np.abs(Y - 120) < 30)
    made = [depth(n, WALL + 0.0005 * X, 1.0) for n in range(1, 6)]
    made[2] = depth(3, np.where(moving, NEAR, WALL + 0.0005 * X), np.where(moving, 0.0, 1.0), moving)
    np.testing.assert_allclose(steady(made, 4).inverse_depth[moving], (WALL + 0.0005 * X)[moving], atol=0.01)
    found = steady(made, 3)
    np.testing.assert_allclose(found.inverse_depth[moving], WALL + 0.0005 * 160, atol=0.01)
    np.testing.assert_array_equal(found.moving, moving)


def test_beside_a_moving_person_the_road_goes_on() -> None:
    """Depth is uncertain in a band round a person before a road that comes nearer from top to bottom."""
    road = WALL + (NEAR - WALL) * (Y / SHAPE[0])
    moving = (np.abs(X - 160) < 30) & (np.abs(Y - 140) < 70)
    band = (np.abs(X - 160) < 38) & (np.abs(Y - 140) < 70) & ~moving
    confidence = np.where(moving, 0.0, np.where(band, 0.2, 1.0))
    wrong = np.where(band, road - 0.05, np.where(moving, 0.02, road))
    found = steady([depth(1, wrong, confidence, moving)], 1).inverse_depth
    off = np.abs(found - road)[band & (np.abs(Y - 140) < 60)] / (NEAR - WALL)
    assert np.median(off) < 0.05 and np.percentile(off, 95) < 0.12


def test_frames_are_brought_into_place() -> None:
    """A frame that knows nothing, between frames that see the near plane elsewhere in the picture."""
    shot = poses(CENTRES)
    frames = {
        n: depth(n, truth(centre), 0.0 if n == MIDDLE else 0.9) for n, centre in enumerate(CENTRES, start=1)
    }
    found = TemporalFusion(shot, Given(frames)).at(MIDDLE)  # type: ignore[arg-type]
    off = np.abs(found.inverse_depth - truth(CENTRES[MIDDLE - 1])) / RANGE
    # No frame says anything of the first and last rows.
    off = off[BORDER:-BORDER]
    assert np.mean(off > 0.05) < 0.01 and np.median(off) < 0.01
    assert (found.confidence > 0.5).mean() > 0.9


def test_past_the_border_depth_is_that_of_the_frames_that_see_it() -> None:
    """The near plane has just left the picture, and the frames before show it."""
    centres, frame = np.column_stack([np.linspace(2.6, 4.9, 13), np.zeros((13, 2))]), 9
    frames = {n: depth(n, truth(centre), 0.9) for n, centre in enumerate(centres, start=1)}
    past = TemporalFusion(poses(centres), Given(frames)).at(frame).past_border  # type: ignore[arg-type]
    assert past is not None
    margin = (past.shape[0] - LENS.height) // 2
    assert past.shape == (LENS.height + 2 * margin, LENS.width + 2 * margin)
    wide = replace(LENS, width=past.shape[1], height=past.shape[0], cx=LENS.cx + margin, cy=LENS.cy + margin)
    true, known = truth(centres[frame - 1], wide), ~np.isnan(past)
    assert not known[margin:-margin, margin:-margin].any()
    # No frame saw what is above.
    assert known[: margin - 2].mean() < 0.01
    beside = (slice(margin + BORDER, -margin - BORDER), slice(0, margin))
    near = true[beside] > 0.2
    assert near.mean() > 0.3 and known[beside][near].mean() > 0.9
    off = np.abs(past - true)[known] / RANGE
    assert np.mean(off > 0.05) < 0.03 and np.median(off) < 0.01
    # That of the frame's edge would be another plane's.
    assert true[margin, margin] < 0.15


# A clip


@pytest.mark.long
def test_a_clips_depth_is_steadier_than_that_of_its_frames() -> None:
    pictures, shot = clip(CENTRES), poses(CENTRES, features())
    single = PlaneSweepStereo(shot, lambda frame: pictures[frame - 1])
    frames = (MIDDLE - 1, MIDDLE, MIDDLE + 1)
    alone = [single.at(frame) for frame in frames]
    both = TemporalFusion(shot, single)
    fused_depth = [both.at(frame) for frame in frames]
    true = [truth(CENTRES[frame - 1]) for frame in frames]
    # The planes face the camera, so where both frames see the same one the depth is the same.
    changes, off = [], []
    for found in (alone, fused_depth):
        pairs = zip(found, found[1:], true, true[1:], strict=False)
        changes.append(
            np.mean([np.abs(b.inverse_depth - a.inverse_depth)[s == t].mean() for a, b, s, t in pairs])
        )
        off.append(np.mean([np.abs(f.inverse_depth - t).mean() for f, t in zip(found, true, strict=True)]))
    print(f"change from frame to frame {changes[0] / RANGE:.4f} alone, {changes[1] / RANGE:.4f} fused")
    print(f"error {off[0] / RANGE:.4f} alone, {off[1] / RANGE:.4f} fused, of the range")
    assert changes[1] < changes[0]
    assert off[1] < 1.1 * off[0]
    assert (fused_depth[0].pinhole.width, fused_depth[0].pinhole.height) == planes.SIZE


# Key frames


class Counted(PlaneSweepStereo):
    """Tells which frames were swept."""

    swept: list[int]

    def at(self, frame: int) -> DenseDepth:
        self.swept.append(frame)
        return super().at(frame)


def track(aside: float = 0.0) -> Floats:
    """(16, 3) centres of cameras in a row, of which the eighth stands aside."""
    centres = np.column_stack([np.linspace(-0.6, 0.6, 16), np.zeros((16, 2))])
    centres[7, 0] += aside
    return centres


HALF = LENS.scaled(LENS.width // 2, LENS.height // 2)


@cache
def pictures() -> list[NDArray[np.uint8]]:
    """Of the cameras in a row, at half their size. Not to be written to."""
    return planes.halved(clip(track()))


def counted(aside: float = 0.0, store: Store = NOT_KEPT) -> tuple[Counted, TemporalFusion]:
    """Depth of the track's frames from pictures of half the size, and what sweeps them."""
    shot = poses(track(aside), features(), HALF)
    shown = planes.halved(clip(track(aside))) if aside else pictures()
    single = Counted(shot, lambda frame: shown[frame - 1])
    single.swept = []
    return single, TemporalFusion(shot, single, store)


def test_a_frame_between_key_frames_is_not_swept() -> None:
    single, fusion = counted()
    found = fusion.at(8)
    assert single.swept == [3, 5, 7, 9, 11, 13]
    off = np.abs(found.inverse_depth - truth(track()[7], HALF)) / RANGE
    assert np.mean(off > 0.05) < 0.05 and np.median(off) < 0.02
    # The last frame is a key frame: nothing comes after it.
    single.swept.clear()
    fusion.at(16)
    assert single.swept == [15, 16]


def test_a_frame_that_key_frames_see_too_little_of_is_swept_itself() -> None:
    single, fusion = counted(aside=1.5)
    fusion.at(8)
    assert single.swept.count(8) == 1


def test_kept_depth_is_the_same_and_not_found_again(tmp_path: Path) -> None:
    store = Store(tmp_path, lambda: "key")
    _, fusion = counted(store=store)
    found = fusion.at(8)
    single, again = counted(store=Store(tmp_path, lambda: "key"))
    kept = again.at(8)
    assert single.swept == []
    for one, other in ((found, kept), (counted()[1].at(8), kept)):
        np.testing.assert_array_equal(one.inverse_depth, other.inverse_depth)
        np.testing.assert_array_equal(one.confidence, other.confidence)
        np.testing.assert_array_equal(one.moving, other.moving)
        np.testing.assert_array_equal(one.past_border, other.past_border)


# Steps


def test_ramps_and_shelves_at_silhouettes_become_steps() -> None:
    column = np.arange(60.0)
    for soft in (
        np.interp(column, [28, 32], [WALL, NEAR]),
        np.where(column < 29, WALL, np.where(column < 31, 0.22, NEAR)),
    ):
        found = sharpened(np.broadcast_to(soft, (40, 60)).astype(np.float32), 0.005)
        np.testing.assert_allclose(found, np.where(found > 0.25, NEAR, WALL), rtol=1e-6)
        assert np.all(np.abs((found > 0.25).argmax(axis=1) - 30) <= 1)


def test_holes_of_a_few_pixels_are_closed_and_larger_ones_stay() -> None:
    inverse = np.full((40, 60), NEAR, np.float32)
    inverse[10, 10] = inverse[20, 20:26] = inverse[30:32, 30:33] = WALL
    inverse[5:8, 40:43] = inverse[10:, 50:] = WALL
    found = without_speckles(inverse, 0.005)
    wanted = np.full((40, 60), NEAR, np.float32)
    wanted[5:8, 40:43] = wanted[10:, 50:] = WALL
    np.testing.assert_array_equal(found, wanted)


def test_slopes_and_thin_things_stay() -> None:
    # The whole range within the picture: as steep as surfaces are that are seen at all.
    level = (NEAR - WALL) / LEVELS
    slope = np.broadcast_to(np.linspace(WALL, NEAR, 60), (40, 60)).astype(np.float32)
    np.testing.assert_array_equal(sharpened(slope, level), slope)
    for wide in (1, 2, 3):
        thin = np.full((40, 60), WALL, np.float32)
        thin[:, 30 : 30 + wide] = NEAR
        np.testing.assert_array_equal(sharpened(thin, level), thin)


@pytest.mark.parametrize(
    ("sure", "height", "side", "stays"),
    [(0.4, 20, 7, False), (0.9, 20, 7, True), (0.4, 4, 7, True), (0.4, 20, 40, True), (0.4, -20, 7, True)],
    ids=["unsure", "sure", "hardly nearer", "large", "farther"],
)  # fmt: skip
def test_small_unsure_islands_that_are_nearer_go(sure: float, height: int, side: int, stays: bool) -> None:
    level = 0.005
    inverse = (0.2 + 0.0002 * X).astype(np.float32)
    island = np.s_[100 : 100 + side, 150 : 150 + side]
    made, confidence = inverse.copy(), np.full(SHAPE, 0.8, np.float32)
    made[island] += height * level
    confidence[island] = sure
    found = without_islands(made, confidence, level)
    if stays:
        np.testing.assert_array_equal(found, made)
    else:
        np.testing.assert_allclose(found, inverse, atol=level)
        np.testing.assert_array_equal(found[:100], made[:100])
