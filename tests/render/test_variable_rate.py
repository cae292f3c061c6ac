"""Movies of clips whose frames come at varying times, or whose sound comes later than the picture."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.media.clip import open_footage
from addon.core.media.constant_rate import held_frames
from addon.render.output import movie_file
from addon.scene.build import build
from benchmarks.odd_clips import SIZE, flashes_and_clicks, steady, varying, write
from benchmarks.torture import clip as solved


def joined(footage_path: Path, folder: Path, frames: range | None = None) -> Path:
    """A movie of the clip's own pictures, as if they had been rendered."""
    footage = open_footage(footage_path)
    scene = bpy.context.scene
    lens = solved.Intrinsics(*SIZE, 60.0, 60.0, SIZE[0] / 2, SIZE[1] / 2)
    build(scene, footage, solved.truth(range(1, 9), lens))
    folder.mkdir()
    files = {}
    for frame in frames or footage.frames:
        files[frame] = folder / f"{frame:06d}.png"
        cv2.imwrite(str(files[frame]), footage.read(frame)[..., ::-1])
    movie_file.join(scene, files, folder.with_suffix(".mp4"))
    return folder.with_suffix(".mp4")


@pytest.mark.parametrize("late", [0.0, 0.48])
def test_flashes_and_clicks_of_a_varying_rate_stay_together(
    tmp_path: Path, scene: bpy.types.Scene, late: float
) -> None:
    times = varying(9)
    flashes = [min(time for time in times if time >= at) for at in range(1, 8)]
    clip = write(tmp_path / "clip.mp4", times, sound=9 - late, late=late, flashes=flashes)
    lit, heard = flashes_and_clicks(joined(clip, tmp_path / "movie"))
    assert len(lit) == len(heard) == len(flashes)
    off = np.array(lit) - heard
    assert np.abs(off).max() < 0.5 / 60 + 0.002, off
    assert np.allclose(np.array(lit) - lit[0], [float(flash - flashes[0]) for flash in flashes], atol=1 / 60)


def test_sound_that_starts_later_keeps_its_offset(tmp_path: Path, scene: bpy.types.Scene) -> None:
    flashes = [Fraction(1), Fraction(2)]
    for suffix in (".mp4", ".mkv"):
        path = write(tmp_path / f"a{suffix}", steady(75), sound=2.5, late=0.48, flashes=flashes)
        lit, heard = flashes_and_clicks(joined(path, tmp_path / f"movie{suffix[1:]}"))
        assert np.abs(np.array(lit) - heard).max() <= 0.5 / 25 + 0.001
    part = joined(path, tmp_path / "part", range(21, 60))
    lit, heard = flashes_and_clicks(part)
    assert lit[0] == pytest.approx(5 / 25) and np.abs(np.array(lit) - heard).max() <= 0.5 / 25 + 0.001


def test_every_frame_has_its_own_time_for_ten_minutes() -> None:
    times = np.array([float(time) for time in varying(600, each=20)])
    held = held_frames(times, 600.0, 60.0, 0.3217)
    begins = np.flatnonzero(np.diff(held, prepend=-1))
    assert np.array_equal(held[begins], np.arange(len(times)))
    off = (begins + round((times[0] - 0.3217) * 60)) - (times - 0.3217) * 60
    assert np.abs(off).max() <= 0.5 + 1e-6


def test_a_movie_of_more_frames_than_a_strip_holds_has_them_in_order(
    tmp_path: Path, scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(movie_file, "STRIP", 7)
    flashes = [Fraction(1), Fraction(2)]
    path = write(tmp_path / "a.mp4", steady(75), sound=3.0, flashes=flashes)
    lit, heard = flashes_and_clicks(joined(path, tmp_path / "movie"))
    assert np.allclose(lit, [1, 2]) and np.abs(lit - heard).max() <= 0.5 / 25
