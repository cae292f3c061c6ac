"""Feature tracks on pictures whose motion is known."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.errors import UserError
from addon.core.footage import open_footage
from addon.core.tracks import Tracks, new_corners, track_features

from . import planes


def tracked(folder: Path) -> Tracks:
    return track_features(open_footage(folder), lambda *_: None)


def shifted(count: int, step: tuple[float, float]) -> list[np.ndarray]:
    """A texture that slides by `step` pixels a frame."""
    pattern = planes.texture(640, 480, 0)
    moves = [np.array([[1, 0, -100 + i * step[0]], [0, 1, -100 + i * step[1]]]) for i in range(count)]
    return [np.repeat(cv2.warpAffine(pattern, m, planes.SIZE)[..., None], 3, axis=2) for m in moves]


def test_tracks_follow_the_motion(tmp_path: Path) -> None:
    step = np.array([1.75, -0.6])
    tracks = tracked(planes.write_clip(tmp_path / "clip", shifted(6, (1.75, -0.6))))
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(5)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    assert len(a) > 0.8 * len(first)
    error = np.linalg.norm(end[b] - start[a] - 5 * step, axis=1)
    assert np.median(error) < 0.1
    assert np.mean(error < 0.5) > 0.97


def test_observations_are_sorted_and_numbered(tmp_path: Path) -> None:
    tracks = tracked(planes.write_clip(tmp_path / "clip", shifted(4, (3.0, 0.0))))
    assert (np.diff(tracks.frame_index) >= 0).all()
    assert set(np.unique(tracks.track)) == set(range(tracks.count))
    for index in range(4):
        assert (np.diff(tracks.in_frame(index)[0]) > 0).all()
    assert (tracks.xy >= 0).all() and (tracks.xy <= planes.SIZE).all()


def test_the_whole_frame_is_covered_and_stays_covered(tmp_path: Path) -> None:
    tracks = tracked(planes.write_clip(tmp_path / "clip", shifted(12, (8.0, 0.0))))
    for index in (0, 11):
        xy = tracks.in_frame(index)[1]
        assert len(xy) > 500
        cells = {(int(x * 8 // 320), int(y * 6 // 240)) for x, y in xy}
        assert len(cells) == 48


def test_weak_texture_beside_strong_is_not_forgotten() -> None:
    gray = planes.texture(*planes.SIZE, 0)
    gray[:, 160:] = 128 + (gray[:, 160:].astype(int) - 128) // 8
    corners = new_corners(gray, np.zeros((0, 2), np.float32))
    assert (corners[:, 0] > 168).sum() > 100


def test_a_plain_picture_has_no_corners() -> None:
    assert len(new_corners(np.full((240, 320), 90, np.uint8), np.zeros((0, 2), np.float32))) == 0


def test_large_frames_are_tracked_small_but_told_in_their_own_pixels(tmp_path: Path) -> None:
    big = [cv2.resize(p, (2001, 1502), interpolation=cv2.INTER_CUBIC) for p in shifted(3, (2.0, 0.0))]
    tracks = tracked(planes.write_clip(tmp_path / "clip", big))
    first, start = tracks.in_frame(0)
    last, end = tracks.in_frame(2)
    _, a, b = np.intersect1d(first, last, return_indices=True)
    np.testing.assert_allclose(np.median(end[b] - start[a], axis=0), [4 * 2001 / 320, 0], atol=0.2)
    assert tracks.xy[:, 0].max() > 1900


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
def test_colours_are_the_pictures(tmp_path: Path, kind: str) -> None:
    picture = np.repeat(planes.texture(*planes.SIZE, 0)[..., None], 3, axis=2)
    picture[..., 0] //= 2  # blue, as OpenCV writes it
    if kind == "uint16":
        picture = picture.astype(np.uint16) * 257
    tracks = tracked(planes.write_clip(tmp_path / "clip", [picture] * 3))
    x, y = tracks.in_frame(0)[1].astype(int).T
    expected = (picture[y, x, ::-1] >> 8) if kind == "uint16" else picture[y, x, ::-1]
    assert tracks.rgb.dtype == np.uint8
    np.testing.assert_array_equal(tracks.rgb[tracks.in_frame(0)[0]], expected)


def test_two_frames_are_too_few(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="at least 3"):
        tracked(planes.write_clip(tmp_path / "clip", shifted(2, (2.0, 0.0))))
