"""Feature tracks on pictures whose motion is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.media.clip import open_footage
from addon.core.sfm.tracking import klt
from addon.core.sfm.tracking.klt import KLTTracker, new_corners
from addon.core.sfm.tracking.tracks import (
    Tracks,
    are_bridged,
    cuts,
    match_features,
    run,
    track_features,
)

from .. import planes

Pictures = list[NDArray[np.uint8]]
TRACKERS: dict[str, Callable[..., Tracks]] = {"harris": track_features, "sift": match_features}
WITH_LONG = ["harris", pytest.param("sift", marks=pytest.mark.long)]
"""SIFT takes several seconds of each clip."""


def tracked(folder: Path, tracker: str = "harris") -> Tracks:
    return TRACKERS[tracker](open_footage(folder))


def rgb(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.repeat(picture[..., None], 3, axis=2)


def shifted(count: int, step: tuple[float, float], seed: int = 0) -> Pictures:
    """A texture that slides by `step` pixels a frame."""
    pattern = planes.texture(640, 480, seed)
    moves = [np.array([[1, 0, -100 + i * step[0]], [0, 1, -100 + i * step[1]]]) for i in range(count)]
    return [rgb(cv2.warpAffine(pattern, m, planes.SIZE)) for m in moves]


def zoomed(count: int, rate: float, noise: float = 1.0) -> tuple[Pictures, Callable[[int], NDArray]]:
    """A texture that grows about the middle by a factor a frame, and where (n, 2) first places go."""
    pattern = planes.texture(960, 720, 4)
    rng = np.random.default_rng(1)
    middle = np.array(planes.SIZE) / 2
    clip = []
    for i in range(count):
        scale = rate**i * 0.7
        # Affine maps of OpenCV's pixels, whose first is (0, 0), about the pictures' middles.
        offset = middle - 0.5 - scale * (np.array([960, 720]) / 2 - 0.5)
        picture = cv2.warpAffine(
            pattern, np.array([[scale, 0, offset[0]], [0, scale, offset[1]]]), planes.SIZE
        )
        noisy = picture + rng.normal(0, noise, picture.shape)
        clip.append(rgb(np.clip(np.rint(noisy), 0, 255).astype(np.uint8)))
    return clip, lambda i: lambda xy: middle + (xy - middle) * rate**i


def across(tracks: Tracks, index: int) -> int:
    """How many tracks are seen both before a frame and from it on."""
    before = np.unique(tracks.track[tracks.frame_index < index])
    return len(np.intersect1d(before, tracks.track[tracks.frame_index >= index]))


def reached(xy: NDArray, size: tuple[int, int]) -> float:
    """Share of an 8 x 6 grid that has a point."""
    cell = np.minimum((xy / (np.array(size) / (8, 6))).astype(int), (7, 5))
    return len(np.unique(cell, axis=0)) / 48


@pytest.mark.parametrize("tracker", TRACKERS)
def test_tracks_follow_the_motion(tmp_path: Path, tracker: str) -> None:
    step = np.array([1.75, -0.6])
    tracks = tracked(planes.write_clip(tmp_path / "clip", shifted(6, (1.75, -0.6))), tracker)
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(5)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    assert len(a) > (0.8 if tracker == "harris" else 0.4) * len(first)
    error = np.linalg.norm(end[b] - start[a] - 5 * step, axis=1)
    assert np.median(error) < 0.1
    assert np.mean(error < 0.5) > 0.97


@pytest.mark.parametrize("tracker", WITH_LONG)
def test_the_whole_frame_is_covered_and_stays_covered(tmp_path: Path, tracker: str) -> None:
    tracks = tracked(planes.write_clip(tmp_path / "clip", shifted(12, (8.0, 0.0))), tracker)
    for index in (0, 11):
        xy = tracks.in_frame(index)[1]
        assert len(xy) > (500 if tracker == "harris" else 250)
        assert reached(xy, planes.SIZE) == 1


def test_where_only_large_things_stand_out_they_are_followed(tmp_path: Path) -> None:
    # Two grey levels of large blotches under noise of one: no corner, but something to hold on to.
    rng = np.random.default_rng(3)
    blotches = cv2.resize(rng.standard_normal((20, 30)).astype(np.float32), (480, 320), interpolation=2)
    clip = []
    for i in range(8):
        picture = 120 + 5 * cv2.warpAffine(blotches, np.array([[1, 0, -60.0 + i], [0, 1, -40]]), planes.SIZE)
        picture[100:120, 150:170] = 10 + 200 * ((np.add.outer(np.arange(20), np.arange(20)) // 5) % 2)
        clip.append(
            rgb(np.clip(np.rint(picture + rng.normal(0, 1.0, picture.shape)), 0, 255).astype(np.uint8))
        )
    footage = open_footage(planes.write_clip(tmp_path / "clip", clip))
    tracks = track_features(footage)
    small = run(KLTTracker(new_corners).step, footage)
    assert reached(tracks.in_frame(7)[1], planes.SIZE) > reached(small.in_frame(7)[1], planes.SIZE) + 0.3
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(7)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    away = np.linalg.norm(start[a] - (160, 110), axis=1) > 40
    assert away.sum() > 20
    assert np.median(np.linalg.norm(end[b][away] - start[a][away] - (7, 0), axis=1)) < 0.7


@pytest.mark.parametrize("tracker", WITH_LONG)
def test_plain_clips_have_no_tracks(tmp_path: Path, tracker: str) -> None:
    tracks = tracked(
        planes.write_clip(tmp_path / "clip", [np.full((240, 320, 3), 90, np.uint8)] * 4), tracker
    )
    assert (tracks.count, len(tracks.xy), cuts(tracks)) == (0, 0, ())


@pytest.mark.parametrize("tracker", WITH_LONG)
def test_long_tracks_do_not_creep(tmp_path: Path, tracker: str) -> None:
    clip, to = zoomed(30, 1.01)
    tracks = tracked(planes.write_clip(tmp_path / "clip", clip), tracker)
    error, span = ends(tracks, to)
    assert (span >= 20).sum() > 40
    assert np.median(error[span >= 20]) < 0.15
    assert np.percentile(error[span >= 20], 90) < 0.4


def ends(tracks: Tracks, to: Callable[[int], NDArray]) -> tuple[NDArray, NDArray]:
    """(count,) how far each track's end is from where its beginning went, and how many frames later."""
    order = np.lexsort([tracks.frame_index, tracks.track])
    number = np.arange(tracks.count)
    first, past = (np.searchsorted(tracks.track[order], number, side) for side in ("left", "right"))
    first, last = order[first], order[past - 1]
    span = tracks.frame_index[last] - tracks.frame_index[first]
    expected = np.array([to(n)(xy) for n, xy in zip(span, tracks.xy[first], strict=True)])
    return np.linalg.norm(tracks.xy[last] - expected, axis=1), span


# Cuts, flashes, pans


@pytest.mark.parametrize("tracker", WITH_LONG)
def test_no_track_lives_through_a_cut(tmp_path: Path, tracker: str) -> None:
    clip = shifted(4, (2.0, 0.0)) + shifted(5, (-1.0, 1.0), seed=9)
    tracks = tracked(planes.write_clip(tmp_path / "clip", clip), tracker)
    assert across(tracks, 4) == 0
    assert min(across(tracks, index) for index in (3, 5, 8)) > 150
    assert cuts(tracks) == (4,)


@pytest.mark.parametrize("tracker", WITH_LONG)
@pytest.mark.parametrize("flash", ["bright", "white"])
def test_a_flash_is_no_cut(tmp_path: Path, tracker: str, flash: str) -> None:
    clip = shifted(8, (2.0, 0.0))
    lit = np.full_like(clip[0], 255) if flash == "white" else np.clip(2.0 * clip[4], 0, 255).astype(np.uint8)
    clip[4] = lit
    tracks = tracked(planes.write_clip(tmp_path / "clip", clip), tracker)
    assert cuts(tracks) == ()
    assert across(tracks, 4) > 150 and across(tracks, 5) > 150
    first, start = tracks.in_frame(3)
    last, end = tracks.in_frame(6)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    assert np.mean(np.linalg.norm(end[b] - start[a] - (6, 0), axis=1) < 0.5) > 0.95


@pytest.mark.parametrize("tracker", WITH_LONG)
def test_a_fast_pan_is_no_cut(tmp_path: Path, tracker: str) -> None:
    # A third of the picture in each frame.
    pattern = rgb(planes.texture(960, 240, 2))
    clip = [pattern[:, i * 105 : i * 105 + 320] for i in range(6)]
    tracks = tracked(planes.write_clip(tmp_path / "clip", clip), tracker)
    assert cuts(tracks) == ()
    assert min(across(tracks, index) for index in range(1, 6)) > 100


def test_cuts_are_where_no_track_lives_on_and_the_picture_changes() -> None:
    # Track 0 ends in frame 1, 1 lives in frames 2 and 3, 2 from 4 on; 3 skips frame 5.
    index = np.array([0, 1, 2, 3, 4, 4, 5, 6, 6], np.int32)
    track = np.array([0, 0, 1, 1, 2, 3, 2, 2, 3], np.int32)

    def made(correlations: list[float]) -> Tracks:
        colours = np.zeros((4, 3), np.uint8)
        return Tracks(tuple(range(7)), 9, 9, index, track, np.zeros((9, 2)), colours, np.array(correlations))

    assert cuts(made([])) == (2, 4)
    assert cuts(made([1, 1, 0.1, 1, 0.9, 1, 0.1])) == (2,)
    # A frame without any track begins nothing, the next that has one does.
    index, track = np.array([0, 0, 3, 3], np.int32), np.arange(4, dtype=np.int32)
    faded = Tracks((1, 2, 3, 4), 9, 9, index, track, np.zeros((4, 2)), np.zeros((4, 3), np.uint8))
    assert cuts(faded) == (3,)


def test_keypoints_connect_frames_of_a_rolled_camera_and_not_those_of_a_cut(tmp_path: Path) -> None:
    clip = shifted(2, (2.0, 0.0)) + [np.rot90(clip, 2) for clip in shifted(2, (3.0, 1.0))]
    clip += shifted(2, (2.0, 0.0), seed=9)
    footage = open_footage(planes.write_clip(tmp_path / "clip", clip))
    assert cuts(track_features(footage)) == (2, 4)
    assert are_bridged(footage, [2]) and are_bridged(footage, [1, 2])
    assert not are_bridged(footage, [4]) and not are_bridged(footage, [2, 4])


# Outliers


def grid(step: int = 20) -> NDArray[np.float32]:
    x, y = np.meshgrid(np.arange(15, 310, step), np.arange(15, 230, step))
    return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)


def seen(xyz: NDArray, centre: NDArray, turn: NDArray) -> NDArray[np.float32]:
    local = (xyz - centre) @ cv2.Rodrigues(turn)[0].T
    return np.float32(local[:, :2] / local[:, 2:] * planes.FOCAL + np.array(planes.SIZE) / 2)


def test_a_point_that_jumps_by_itself_is_a_stray() -> None:
    rng = np.random.default_rng(0)
    before = grid()
    depth = rng.uniform(4, 9, len(before))
    rays = np.column_stack([(before - np.array(planes.SIZE) / 2) / planes.FOCAL, np.ones(len(before))])
    after = seen(rays * depth[:, None], np.array([0.05, 0, 0.02]), np.array([0, 0.004, 0.001]))
    moves = after - before
    wrong = rng.choice(len(before), 9, replace=False)
    after[wrong] += np.float32([[0, 9]])
    np.testing.assert_array_equal(
        np.nonzero(klt.motion_outliers(before, after, moves, 20))[0], np.sort(wrong)
    )


def test_parallax_pans_planes_and_moving_objects_are_no_strays() -> None:
    before = grid()
    flat = np.column_stack([(before - np.array(planes.SIZE) / 2) / planes.FOCAL, np.ones(len(before))])
    still, moved = np.zeros(3), np.array([0.3, 0.1, 0])
    # Lone near points before a far wall move by themselves, and did so before.
    near = seen(flat * np.where(np.arange(len(flat)) % 31 == 7, 1.5, 8.0)[:, None], moved, still)
    assert not klt.motion_outliers(before, near, near - before, 20).any()
    # A camera that begins to pan, or to pass a wall, and a thing over a third of the picture that sets out.
    none = np.zeros_like(before)
    assert not klt.motion_outliers(before, seen(flat, still, np.array([0.01, 0.05, 0.02])), none, 20).any()
    assert not klt.motion_outliers(before, seen(8 * flat, moved, still), none, 20).any()
    thing = seen(8 * flat, moved, still)
    thing[before[:, 0] < 115] += np.float32([[7, -11]])
    assert not klt.motion_outliers(before, thing, none, 20).any()
    # Points that are new have not moved before.
    assert not klt.motion_outliers(before, near, np.full_like(before, np.nan), 20).any()


# The rest


def test_large_frames_are_tracked_small_but_told_in_their_own_pixels(tmp_path: Path) -> None:
    big = [cv2.resize(p, (2001, 1502), interpolation=cv2.INTER_CUBIC) for p in shifted(4, (2.0, 0.0))]
    tracks = tracked(planes.write_clip(tmp_path / "clip", big))
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(2)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    np.testing.assert_allclose(np.median(end[b] - start[a], axis=0), [4 * 2001 / 320, 0], atol=0.2)
    assert tracks.xy[:, 0].max() > 1900


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_colours_are_the_pictures(tmp_path: Path, kind: str) -> None:
    picture = rgb(planes.texture(*planes.SIZE, 0))
    picture[..., 0] //= 2  # blue, as OpenCV writes it
    if kind == "uint16":
        picture = picture.astype(np.uint16) * 257
    tracks = tracked(planes.write_clip(tmp_path / "clip", [picture] * 4))
    x, y = tracks.in_frame(0)[1].astype(int).T
    expected = (picture[y, x, ::-1] >> 8) if kind == "uint16" else picture[y, x, ::-1]
    assert tracks.rgb.dtype == np.uint8
    np.testing.assert_array_equal(tracks.rgb[tracks.in_frame(0)[0]], expected)


@pytest.mark.parametrize(("tracker", "size"), [("harris", (1, 1)), ("sift", (9, 16))])
def test_tiny_frames_are_no_trouble(tmp_path: Path, tracker: str, size: tuple[int, int]) -> None:
    clip = [rgb(planes.texture(*size, seed)) for seed in range(4)]
    tracks = tracked(planes.write_clip(tmp_path / "clip", clip), tracker)
    assert tracks.frames == (1, 2, 3, 4)


# Repeated bars


def barred(count: int, period: int, step: float, seed: int) -> Pictures:
    """A wall that slides, whose middle is plain panels a `period` wide with level seams."""
    wall = planes.texture(900, 240, seed).astype(np.float32)
    x = np.arange(900)
    wall[60:180] = 120 - 35 * np.clip(1.5 - np.abs((x + period / 2) % period - period / 2), 0, 1)
    for row in (80, 120, 160):
        wall[row : row + 2] -= 12
    wall = np.asarray(cv2.GaussianBlur(wall, (0, 0), 0.7), np.float32)
    noise = np.random.default_rng(seed)
    made = []
    for i in range(count):
        move = np.array([[1, 0, -200 + i * step], [0, 1, 0.0]])
        seen = cv2.warpAffine(wall, move, planes.SIZE, flags=cv2.INTER_CUBIC) + noise.normal(0, 1, (240, 320))
        made.append(np.clip(np.rint(seen), 0, 255).astype(np.uint8))
    return made


@pytest.mark.parametrize(("period", "step"), [(8, 3.7), (10, 4.5), (12, 6.0), (14, 4.5)])
def test_no_track_takes_one_of_many_bars_for_the_next(period: int, step: float) -> None:
    tracker, before, hops, steps = klt.TwoScales(new_corners), {}, 0, 0
    for gray in barred(8, period, step, seed=period):
        now = dict(zip(*(each.tolist() for each in tracker.step(gray)), strict=True))
        moves = [now[each][0] - before[each][0] - step for each in now.keys() & before.keys()]
        hops, steps, before = hops + np.count_nonzero(np.abs(moves) > period / 2), steps + len(moves), now
    assert steps > 3000
    assert hops <= 2
