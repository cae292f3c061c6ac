"""Clips as they come: frames, times and damage from packets, and what is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import open_footage
from addon.core.media.frame_table import read_table
from benchmarks.odd_clips import LISTS, flipped, packets, steady, varying, write


@pytest.mark.parametrize(
    ("name", "codec"),
    [
        ("a.mkv", "libx265"), ("a.webm", "libvpx-vp9"), ("a.ts", "libx264"), ("a.mov", "mpeg4"),
        ("a.avi", "mpeg4"), ("a.wmv", "wmv2"),
    ],
)  # fmt: skip
def test_sound_longer_than_the_pictures_is_no_truncation(tmp_path: Path, name: str, codec: str) -> None:
    footage = open_footage(write(tmp_path / name, steady(100), codec, sound=4.2))
    assert len(footage.frames) == 100 and footage.fps == pytest.approx(25, rel=0.02)
    assert footage.video is not None and not footage.video.missing and not footage.video.damaged


def test_a_clip_of_varying_rate_is_whole_and_has_its_own_times(tmp_path: Path) -> None:
    times = varying(12)
    for name in ("a.mp4", "a.mkv"):
        footage = open_footage(write(tmp_path / name, times, sound=12.0))
        assert footage.video is not None and footage.video.is_variable
        assert np.allclose(footage.video.seconds, [float(time) for time in times], atol=0.002)
        assert footage.fps == pytest.approx((len(times) - 1) / float(times[-1]), rel=1e-3)
        assert not footage.video.missing and not footage.video.damaged
        assert any("variable frame rate" in note for note in footage.notes)


def test_empty_packets_of_an_avi_are_no_lost_frames(tmp_path: Path) -> None:
    times = [time for at, time in enumerate(steady(100)) if not 5 < at % 25 < 11]
    footage = open_footage(write(tmp_path / "a.avi", times, "mpeg4"))
    assert len(footage.frames) == len(times) and footage.video is not None and footage.video.is_variable
    assert np.allclose(footage.video.seconds, [float(time) for time in times])


def test_frames_before_an_edit_list_are_not_shown_and_not_missed(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mp4", steady(100), bf="3", g="25")
    # As `ffmpeg -ss 0.5 -c copy`: from the key frame before, whose time is negative.
    with av.open(str(whole)) as source, av.open(str(tmp_path / "cut.mp4"), "w") as out:
        stream = out.add_stream_from_template(source.streams.video[0])
        begin = round(0.52 / source.streams.video[0].time_base)
        for packet in source.demux(video=0):
            if packet.dts is not None and packet.pts is not None:
                packet.pts, packet.dts = packet.pts - begin, packet.dts - begin
                packet.stream = stream
                out.mux(packet)
    footage, before = open_footage(tmp_path / "cut.mp4"), open_footage(whole)
    assert len(footage.frames) == 87 and not footage.notes
    for frame in (1, 40, 87, 2):
        assert np.array_equal(footage.read(frame), before.read(frame + 13))


def test_the_last_frames_that_are_missing_are_named(tmp_path: Path) -> None:
    # As cameras on a memory card write it: all is known before the pictures come.
    path = write(tmp_path / "a.mkv", steady(200), sound=8.0)
    at = packets(path)[197][0]
    path.write_bytes(path.read_bytes()[:at])
    footage = open_footage(path)
    assert len(footage.frames) == 197
    assert any("frames 198-200 of 200 cannot be read" in note for note in footage.notes)


def test_a_clip_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    for name, codec in (("a.mkv", "libx264"), ("a.avi", "mpeg4")):
        path = write(tmp_path / name, steady(100), codec)
        path.write_bytes(path.read_bytes()[: packets(path)[60][0]])
        with pytest.raises(UserError, match=r"cut off: frame \d+ of 100 cannot be decoded"):
            open_footage(path)


@pytest.mark.parametrize(
    ("name", "codec"),
    [
        ("a.mp4", "libx264"),
        ("a.mkv", "libx264"),
        ("a.avi", "mpeg4"),
        ("a.ts", "mpeg2video"),
        ("a.avi", "mjpeg"),
    ],
)
def test_a_frame_whose_packet_is_damaged_is_named(tmp_path: Path, name: str, codec: str) -> None:
    packet = 48
    path = flipped(write(tmp_path / name, steady(50), codec, block=2, bf="0", g="25"), packet)
    footage = open_footage(path)
    assert footage.video is not None and packet + 1 in footage.video.damaged, footage.video.damaged
    assert len(footage.frames) == 50
    assert any(f"{packet + 1}" in note and "damaged in the file" in note for note in footage.notes)


@pytest.mark.long
def test_damage_is_told_on_a_busy_machine(tmp_path: Path) -> None:
    # Where threads decode frames side by side, FFmpeg's MPEG-4 tells of damage only if they are soon enough.
    path = flipped(write(tmp_path / "a.mov", steady(60), "mpeg4", block=4), 1, 942130310)
    busy = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))
    ]
    try:
        found = {read_table(path).damaged for _ in range(40)}
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert found == {(2,)}


def test_frames_that_are_lost_between_others_are_told(tmp_path: Path) -> None:
    times = steady(50)
    for name, codec in (("a.ts", "mpeg2video"), ("a.mp4", "libx264")):
        part = [time for number, time in enumerate(times, 1) if number not in (20, 31)]
        footage = open_footage(write(tmp_path / name, part, codec, g="1"))
        assert len(footage.frames) == 48
        assert any("after frames 19, 29 of the clip there is a gap" in note for note in footage.notes)
        assert not open_footage(write(tmp_path / f"whole_{name}", times, codec, g="1")).notes


def test_frames_are_the_same_in_whichever_order_they_are_read(tmp_path: Path) -> None:
    for name, codec in (
        ("a.mp4", "libx264"),
        ("a.mkv", "libx265"),
        ("a.mkv", "libvpx-vp9"),
        ("a.ts", "libx264"),
    ):
        footage = open_footage(write(tmp_path / f"{codec}{name}", steady(60), codec, g="12", bf="2"))
        forwards = {frame: footage.read(frame) for frame in footage.frames}
        order = np.random.default_rng(0).permutation(footage.frames)
        for frame in map(int, order):
            assert np.array_equal(footage.read(frame), forwards[frame]), (name, codec, frame)


def test_av1_is_read(tmp_path: Path) -> None:
    times = steady(20)
    plain = open_footage(write(tmp_path / "plain.mp4", times, qp="1"))
    footage = open_footage(write(tmp_path / "a.mp4", times, "libsvtav1", crf="10", preset="10"))
    # The encoder asks for all of the machine.
    assert not hasattr(os, "sched_getscheduler") or os.sched_getscheduler(0) == os.SCHED_OTHER
    assert len(footage.frames) == 20
    for frame in (1, 11, 20):
        assert np.abs(footage.read(frame).astype(int) - plain.read(frame)).mean() < 4


@pytest.mark.parametrize("kind", LISTS)
def test_a_list_that_leads_to_other_files_is_refused(tmp_path: Path, kind: str) -> None:
    write(tmp_path / "clip.mp4", steady(5))
    write(tmp_path / "clip.ts", steady(5))
    path = tmp_path / "list.mp4"
    path.write_text(LISTS[kind])
    with pytest.raises(UserError, match="is a playlist, not a video; choose the video itself"):
        open_footage(path)


def test_sound_keeps_its_place(tmp_path: Path) -> None:
    for name in ("a.mp4", "a.mkv"):
        info = open_footage(write(tmp_path / name, steady(50), sound=1.5, late=0.48)).video
        # AAC begins with what it needs before the first sample, 1024 of them.
        assert info is not None and info.sound == pytest.approx(0.48, abs=0.022)
