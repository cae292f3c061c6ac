"""Front ends and marks of the figures, where the answer is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Pil

from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import decode_srgb
from addon.core.sfm.tracking.tracks import Tracks
from benchmarks.thesis import front_ends
from benchmarks.thesis import marks as draw

from .. import planes
from ..sliding import STEP, gaussians, sliding_clip
from .stills import noise

Floats = NDArray[np.float64]

# Front ends


@pytest.fixture(scope="module")
def sliding(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    return sliding_clip(tmp_path_factory.mktemp("sliding"))


@pytest.mark.parametrize("name", front_ends.FRONTS)
def test_tracks_move_as_the_picture_does(sliding: Footage, name: str) -> None:
    tracks = front_ends.FRONTS[name](sliding)
    assert (tracks.frames, tracks.width, tracks.height) == ((1, 2, 3, 4, 5), 160, 120)
    assert set(tracks.track.tolist()) == set(range(tracks.count))
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(4)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    assert len(a) > 20
    error = np.linalg.norm(end[b] - start[a] - 4 * STEP, axis=1)
    assert np.median(error) < 0.15
    assert np.mean(error < 0.6) > 0.9
    for index in range(5):
        number, xy = tracks.in_frame(index)
        assert (np.diff(number) > 0).all()
        assert np.all((xy >= 0) & (xy <= [160, 120]))
    assert front_ends.registered(tracks)[2] > 20


@pytest.mark.parametrize("name", front_ends.FRONTS)
def test_pixels_count_from_the_first_ones_corner(tmp_path: Path, name: str) -> None:
    # All far apart, and on the middles of pixels, which is all that Harris's detector can tell.
    x, y = np.meshgrid(np.arange(20.5, 150, 25), np.arange(20.5, 110, 25))
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    picture = gaussians(places, np.full(len(places), 1.6), np.full(len(places), 140.0), (160, 120))
    tracks = front_ends.FRONTS[name](open_footage(planes.write_clip(tmp_path / "clip", [picture] * 4)))
    xy = tracks.in_frame(0)[1]
    away = np.linalg.norm(xy[:, None] - places, axis=2)
    assert away.min(axis=0).max() < 0.3  # a feature on every blob
    offset = (xy - places[away.argmin(axis=1)])[away.min(axis=1) < 3]
    np.testing.assert_allclose(np.median(offset, axis=0), 0, atol=0.1)


def test_a_place_is_one_keypoint_whatever_its_orientations(sliding: Footage) -> None:
    for front in (front_ends.sift_sift, front_ends.sift_klt):
        xy = front(sliding).in_frame(0)[1]
        apart = np.linalg.norm(xy[:, None] - xy, axis=2)[~np.eye(len(xy), dtype=bool)]
        assert apart.min() > 0.2


@pytest.mark.parametrize("front", [front_ends.harris_klt, front_ends.sift_klt, front_ends.sift_sift])
def test_plain_frames_have_no_features(tmp_path: Path, front: Callable[[Footage], Tracks]) -> None:
    clip = planes.write_clip(tmp_path / "clip", [np.full((120, 160, 3), 90, np.uint8)] * 4)
    tracks = front(open_footage(clip))
    assert tracks.count == 0
    assert front_ends.registered(tracks).tolist() == [0, 0, 0, 0]


def test_matches_undo_a_shuffle_and_are_sure() -> None:
    rng = np.random.default_rng(0)
    before = rng.uniform(0, 100, (40, 128)).astype(np.float32)
    order = rng.permutation(40)
    after = before[order] + rng.normal(0, 2, (40, 128)).astype(np.float32)
    old, new = front_ends.matched(before, after)
    assert old.tolist() == list(range(40))
    np.testing.assert_array_equal(order[new], old)
    # One that has two nearly equal partners is left out, and so are strangers.
    twin = np.concatenate([after, after[new[:1]] + 0.01])
    old, new = front_ends.matched(before, twin)
    assert old.tolist() == list(range(1, 40))
    assert len(front_ends.matched(before, rng.uniform(0, 100, (40, 128)).astype(np.float32))[0]) == 0


def test_a_match_is_the_best_for_both() -> None:
    # Both old ones are nearest to the first new one, which is nearest to the second old one.
    before = np.array([[0.0, 0.0], [1.0, 0.0]], np.float32)
    after = np.array([[1.2, 0.0], [90.0, 0.0]], np.float32)
    old, new = front_ends.matched(before, after)
    assert (old.tolist(), new.tolist()) == ([1], [0])
    assert [len(rows) for rows in front_ends.matched(before[:1], after)] == [0, 0]


@pytest.mark.parametrize(("best", "is_clear"), [(7.5, True), (8.5, False)])
def test_the_best_is_clear_by_lowes_ratio(best: float, is_clear: bool) -> None:
    before = np.array([[0.0, 0.0], [90.0, 0.0]], np.float32)
    after = np.array([[best, 0.0], [0.0, 10.0], [90.0, 0.0]], np.float32)
    old, _ = front_ends.matched(before, after)
    assert old.tolist() == ([0, 1] if is_clear else [1])


def test_registered_are_those_that_live_three_frames() -> None:
    # Track 0 is seen in frames 0 to 2, 1 in frames 1 and 2, 2 in 1 to 4; nothing else in frame 5.
    index, track = [0, 1, 1, 1, 2, 2, 2, 3, 4], [0, 0, 1, 2, 0, 1, 2, 2, 2]
    tracks = Tracks(
        (1, 2, 3, 4, 5, 6), 160, 120, np.array(index, np.int32), np.array(track, np.int32),
        np.zeros((9, 2)), np.zeros((3, 3), np.uint8),
    )  # fmt: skip
    assert front_ends.registered(tracks).tolist() == [1, 2, 2, 1, 1, 0]


# Marks and sheets

GREY = np.full((60, 80, 3), 100, np.uint8)


def ink(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> Floats:
    """(H, W) how far each pixel has changed."""
    return np.abs(after.astype(np.float64) - before).sum(axis=2)


def centre_of(weight: Floats) -> Floats:
    """x, y in pixels, the centre of the first one at (0.5, 0.5)."""
    row, column = np.indices(weight.shape)
    return np.array([(weight * column).sum(), (weight * row).sum()]) / weight.sum() + 0.5


def test_the_first_pixels_centre_is_at_a_half() -> None:
    drawn = draw.marks(GREY, np.array([[0.5, 0.5]]), "+", draw.RED, arm=3)
    changed = ink(GREY, drawn)
    assert changed[0, :3].min() > 1.5 * changed[1, 1:].max()
    assert changed[:3, 0].min() > 1.5 * changed[1:, 1].max()
    assert not changed[2:, 2:].any()
    assert (GREY == 100).all(), "the frame itself was drawn on"


@pytest.mark.parametrize("kind", ["+", "x", "square"])
@pytest.mark.parametrize("zoom", [1.0, 1.5])
def test_marks_are_where_they_should_be(kind: str, zoom: float) -> None:
    page = draw.enlarged(GREY, zoom)
    for place in ([30.5, 20.5], [31.0, 22.25], [40.7, 33.1]):
        drawn = ink(page, draw.marks(page, np.array([place]), kind, draw.WHITE, zoom=zoom, arm=6))
        np.testing.assert_allclose(centre_of(drawn), np.array(place) * zoom, atol=0.15)
        rows, columns = np.nonzero(drawn)
        # The arm is in pixels of the page; an end is soft over two pixels.
        assert 12 <= np.ptp(rows) <= 16 and 12 <= np.ptp(columns) <= 16


def test_an_enlarged_dot_stays_under_its_mark() -> None:
    dot = GREY.copy()
    dot[20, 30] = 255
    page = draw.enlarged(GREY, 3), draw.enlarged(dot, 3)
    np.testing.assert_allclose(centre_of(ink(*page)), [3 * 30.5, 3 * 20.5], atol=0.05)
    assert page[0].shape == (180, 240, 3)


def test_a_plus_and_a_cross_differ_by_an_eighth_of_a_turn() -> None:
    at = np.array([[30.5, 20.5]])
    plus, cross = (ink(GREY, draw.marks(GREY, at, kind, draw.WHITE, arm=5)) for kind in "+x")
    assert plus[20, 27] and plus[17, 30] and not plus[17, 27]
    assert cross[17, 27] and cross[23, 27] and not cross[20, 27]


def test_lines_run_from_end_to_end() -> None:
    drawn = draw.lines(GREY, np.array([[[10.5, 5.5], [40.5, 35.5]]]), draw.YELLOW)
    steps = np.arange(1, 30)
    assert (drawn[5 + steps, 10 + steps] == draw.YELLOW).all()
    changed = np.argwhere(ink(GREY, drawn))
    assert np.abs((changed[:, 0] - 5) - (changed[:, 1] - 10)).max() <= 1
    assert changed[:, 0].min() >= 4 and changed[:, 0].max() <= 36


def test_a_mesh_is_its_edges_each_drawn_once() -> None:
    xy = np.array([[10.0, 10.0], [60.0, 14.0], [15.0, 50.0], [66.0, 47.0]])
    two = np.array([[0, 1, 2], [1, 3, 2]], np.int32)
    drawn = draw.mesh(GREY, xy, two, draw.WHITE)
    # Soft lines drawn twice would be brighter.
    twice = np.concatenate([two[::-1, ::-1], two])
    np.testing.assert_array_equal(drawn, draw.mesh(GREY, xy, twice, draw.WHITE))
    for a, b, seen in ((0, 1, True), (1, 2, True), (2, 3, True), (0, 3, False)):
        column, row = (0.75 * xy[a] + 0.25 * xy[b]).astype(int)
        assert bool(ink(GREY, drawn)[row - 1 : row + 2, column - 1 : column + 2].any()) == seen


def test_spread_leaves_one_of_each_square() -> None:
    xy = np.random.default_rng(1).uniform(0, 100, (500, 2))
    kept = draw.spread(xy, 25)
    squares = (xy // 25).astype(int)
    assert len(kept) == 16 and (np.diff(kept) > 0).all()
    assert {tuple(s) for s in squares[kept].tolist()} == {tuple(s) for s in squares.tolist()}


def found_at(page: NDArray[np.uint8], picture: NDArray[np.uint8]) -> tuple[int, int]:
    """Row and column of a picture on a page, which must hold it once and to the bit."""
    score = cv2.matchTemplate(page, picture, cv2.TM_SQDIFF)
    row, column = np.unravel_index(score.argmin(), score.shape)
    height, width = picture.shape[:2]
    np.testing.assert_array_equal(page[row : row + height, column : column + width], picture)
    return int(row), int(column)


@pytest.mark.parametrize("lettered", [False, True])
def test_a_sheet_keeps_its_pictures_in_rows_and_columns(lettered: bool) -> None:
    pictures = [[noise(40, 60, seed=3 * row + column) for column in range(3)] for row in range(2)]
    across = ["first column", "two", "3"] if lettered else [""] * 3
    down = ["a long name\nof two lines", "short"] if lettered else [""] * 2
    page = draw.sheet(pictures, across, down, "A title")
    at = np.array([[found_at(page, picture) for picture in row] for row in pictures])
    assert (np.diff(at[..., 0], axis=0) >= 40).all() and (np.diff(at[..., 1], axis=1) >= 60).all()
    assert (np.diff(at[..., 0], axis=1) == 0).all() and (np.diff(at[..., 1], axis=0) == 0).all()
    dark = (page < 60).all(axis=2)
    top, left = at[0, 0]
    assert dark[:top].any(), "no title"
    assert dark[top:, :left].any() == lettered


def test_text_is_as_wide_as_it_is_said_to_be() -> None:
    page = np.full((60, 600, 3), 255, np.uint8)
    draw.text(page, "three blocks, 1.25 px", (20, 40))
    columns = np.nonzero((page < 128).any(axis=(0, 2)))[0]
    assert columns.min() >= 19
    assert np.ptp(columns) == pytest.approx(draw.width_of("three blocks, 1.25 px"), abs=4)


def test_muted_leaves_room_for_black_and_white() -> None:
    every = np.arange(256, dtype=np.uint8)
    muted = draw.muted(np.repeat(every[:, None, None], 3, axis=2))
    assert muted.min() > 50 and muted.max() < 205
    assert (np.diff(muted[:, 0, 0].astype(int)) >= 0).all()


def test_recorded_undoes_linear_light() -> None:
    levels = np.arange(256)
    linear = np.repeat(decode_srgb(levels / 255)[:, None, None], 4, axis=2)
    np.testing.assert_array_equal(draw.recorded(linear)[:, 0], np.repeat(levels[:, None], 3, axis=1))
    assert draw.recorded(np.array([[[-1.0, 2.0, 0.0]]])).tolist() == [[[0, 255, 0]]]


def test_a_small_picture_is_kept_to_the_bit(tmp_path: Path) -> None:
    picture = noise(50, 70)
    draw.save(tmp_path / "small.png", picture)
    np.testing.assert_array_equal(np.asarray(Pil.open(tmp_path / "small.png").convert("RGB")), picture)


def test_a_large_picture_gets_fewer_colours_until_it_is_small(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = noise(100, 200) // 8 + 96
    file = tmp_path / "large.png"
    monkeypatch.setattr(draw, "LIMIT", 21_000)
    draw.save(file, picture)
    assert 16_000 < file.stat().st_size <= 21_000
    read = np.asarray(Pil.open(file).convert("RGB"))
    assert np.abs(read.astype(int) - picture).mean() < 8


def test_what_cannot_be_made_small_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw, "LIMIT", 1000)
    with pytest.raises(ValueError, match=r"huge\.png has \d+ bytes"):
        draw.save(tmp_path / "huge.png", noise(60, 60))
    assert not (tmp_path / "huge.png").exists()
