"""Pictures beside a clip that are fewer or more than its frames: which frame each belongs to."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.depth.user_maps import open_depth
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.media.masks import open_masks

from ..variants import combined

COUNT = 24
SIZE = 32, 18
UNCLEAR = "it is not clear which they belong to"


def write(folder: Path, numbers: Sequence[int]) -> Path:
    """Maps whose values are a hundred times their places, from 1."""
    folder.mkdir()
    for place, number in enumerate(numbers, 1):
        cv2.imwrite(str(folder / f"d_{number:04d}.png"), np.full(SIZE[::-1], 100 * place, np.uint16))
    return folder


def write_video(path: Path, count: int, rate: float) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), rate, (64, 36))
    for place in range(count):
        writer.write(np.full((36, 64, 3), 20 + round(200 * place / count), np.uint8))
    writer.release()
    return path


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    return open_footage(write(tmp_path_factory.mktemp("sequence") / "clip", range(1, COUNT + 1)))


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Footage:
    return open_footage(write_video(tmp_path_factory.mktemp("video") / "clip.mp4", COUNT, 24))


@pytest.mark.parametrize(
    ("first", "count", "packed"),
    combined([0, 1], [12, 15, COUNT - 3, 2 * COUNT, COUNT + 3], {"folder": False, "zip": True}),
)
def test_maps_at_another_rate_are_refused(
    clip: Footage, video: Footage, tmp_path: Path, first: int, count: int, packed: bool
) -> None:
    """Numbers that only count say nothing: given to the first frames, half a subject would be sharp."""
    path = folder = write(tmp_path / "maps", range(first, first + count))
    if packed:
        path = tmp_path / "maps.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for file in folder.iterdir():
                archive.write(file, file.name)
    for footage in (clip, video, open_footage(clip.path, FrameRange(3, 9))):
        with pytest.raises(UserError, match=f"maps.* has {count} depth maps, numbered {first} .*{UNCLEAR}"):
            open_depth(path, footage)


def test_numbers_of_frames_are_believed(clip: Footage, video: Footage, tmp_path: Path) -> None:
    odd = write(tmp_path / "odd", range(1, COUNT, 2))
    from_zero = write(tmp_path / "from_zero", range(0, COUNT, 2))
    late = write(tmp_path / "late", range(5, 40))
    for footage in (clip, video):
        for folder in (odd, from_zero):
            maps = open_depth(folder, footage)
            assert maps.frames == tuple(range(1, COUNT, 2))
            assert maps.notes == ("12 of 24 frames without a depth map",)
            assert [int(maps.read(frame).values[0, 0]) for frame in (1, 3, 23)] == [100, 200, 1200]
        some = open_depth(late, footage)
        assert some.frames == tuple(range(5, COUNT + 1))
        assert "15 of 35 depth maps belong to no frame of the clip" in some.notes


def test_as_many_as_were_solved_belong_to_those(clip: Footage, tmp_path: Path) -> None:
    part = open_footage(clip.path, FrameRange(7, 18))
    maps = open_depth(write(tmp_path / "maps", range(1, 13)), part)
    assert [int(maps.read(frame).values[0, 0]) for frame in (7, 18)] == [100, 1200]
    assert "in order" in maps.notes[0]
    # All maps of the clip, from 0: each its own, whatever part of it is looked at.
    every = open_depth(write(tmp_path / "every", range(COUNT)), part)
    assert [int(every.read(frame).values[0, 0]) for frame in (7, 18)] == [700, 1800] and not every.notes


def test_a_frame_or_two_that_a_program_lost_are_no_other_rate(video: Footage, tmp_path: Path) -> None:
    maps = open_depth(write(tmp_path / "maps", range(COUNT - 1)), video)
    assert maps.frames == tuple(range(1, COUNT)) and maps.notes == ("1 of 24 frames without a depth map",)
    np.savez(tmp_path / "more.npz", depths=np.ones((COUNT + 1, 18, 32)))
    assert open_depth(tmp_path / "more.npz", video).frames == video.frames


@pytest.mark.parametrize(("count", "rate"), [(12, 12), (48, 48), (15, 15), (8, 8)])
def test_videos_are_matched_by_time(video: Footage, tmp_path: Path, count: int, rate: float) -> None:
    path = write_video(tmp_path / "maps.mp4", count, rate)
    for opened in (open_depth, open_masks):
        found = opened(path, video)
        assert len(found.frames) == min(count, COUNT) and "by time" in found.notes[0]
        for frame, number in found.numbers.items():
            assert abs((frame - 1) / 24 - (number - 1) / rate) <= 0.5 / 24 + 1e-6
        # A part of the clip takes its own.
        part = opened(path, open_footage(video.path, FrameRange(13, 24)))
        assert part.numbers == {frame: number for frame, number in found.numbers.items() if frame > 12}


def test_videos_of_other_lengths_are_refused(clip: Footage, video: Footage, tmp_path: Path) -> None:
    """Half of the frames at the clip's rate: they may be those of half its time, or of all of it."""
    half = write_video(tmp_path / "half.mp4", 12, 24)
    for footage in (clip, video):
        for opened in (open_depth, open_masks):
            with pytest.raises(UserError, match=UNCLEAR):
                opened(half, footage)
