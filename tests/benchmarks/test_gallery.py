from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.gallery import clips, commands, metrics, scores, sheet, stages, table
from benchmarks.gallery.commands import Ended
from benchmarks.gallery.scores import Row

SIZE = 480, 640
ENDED = Ended(0, "Good solve", "", 10.0, None, 12.0)


@pytest.fixture(scope="module")
def source() -> metrics.Pixels:
    """(480, 640, 3) random blobs of a few pixels on the left three quarters; the rest is flat."""
    noise = np.random.default_rng(1).normal(size=SIZE).astype(np.float32)
    blobs = cv2.GaussianBlur(noise, (0, 0), 2.0)
    blobs[:, 480:] = 0
    grey = np.clip(128 + 40 * blobs / blobs.std(), 20, 235).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


@pytest.fixture
def subject() -> metrics.Mask:
    mask = np.zeros(SIZE, bool)
    mask[120:360, 60:200] = True
    return mask


def noisy(picture: metrics.Pixels, sigma: float, seed: int = 2) -> metrics.Pixels:
    noise = np.random.default_rng(seed).normal(0, sigma, SIZE)[..., None]
    return np.clip(np.rint(picture + noise), 0, 255).astype(np.uint8)


def smooth(picture: metrics.Pixels, sigma: float = 8.0) -> metrics.Pixels:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma), np.uint8)


def refocused(picture: metrics.Pixels, subject: metrics.Mask) -> metrics.Pixels:
    """The subject sharp, all else blurred."""
    return np.where(subject[..., None], picture, smooth(picture))


def test_a_sharp_subject_before_a_blurred_background(source: metrics.Pixels, subject: metrics.Mask) -> None:
    found = metrics.detail(source, refocused(source, subject), subject)
    assert found.subject > 0.95 and found.tiles_lost == 0
    assert found.elsewhere < 0.1


def test_a_blurred_half_of_a_subject_is_half_of_its_tiles(
    source: metrics.Pixels, subject: metrics.Mask
) -> None:
    sharp = subject.copy()
    sharp[240:] = False
    found = metrics.detail(source, refocused(source, sharp), subject)
    assert 0.4 < found.subject < 0.6
    assert found.tiles_lost == pytest.approx(0.5, abs=0.05)


def test_noise_and_misplaced_detail_are_no_detail(source: metrics.Pixels, subject: metrics.Mask) -> None:
    blurred = metrics.detail(source, smooth(source), subject).subject
    assert metrics.detail(source, noisy(smooth(source), 8), subject).subject == pytest.approx(
        blurred, abs=0.03
    )
    assert metrics.detail(source, np.roll(source, 20, axis=1), subject).subject < 0.1


def test_noise_is_measured_where_it_is_flat_and_blurred(
    source: metrics.Pixels, subject: metrics.Mask
) -> None:
    before = noisy(source, 2.0)
    result = noisy(refocused(source, subject), 6.0, seed=3)
    found = metrics.noise(before, result, subject)
    assert found.source == pytest.approx(2, rel=0.1) and found.result == pytest.approx(6, rel=0.1)
    assert found.ratio == pytest.approx(6 / np.hypot(2, metrics.DITHER), rel=0.15)


def test_flicker_is_that_of_the_results_over_the_sources(
    source: metrics.Pixels, subject: metrics.Mask
) -> None:
    """The sources' brightness changes by 2 of 255 from frame to frame, and the results' by 2 or by 6."""
    sources = [np.asarray(source + np.uint8(2 * (n % 2))) for n in range(3)]
    calm = [refocused(each, subject) for each in sources]
    restless = [np.asarray(each + np.uint8(4 * (n % 2))) for n, each in enumerate(calm)]
    subjects = [subject] * 3
    assert metrics.flicker(sources, calm, subjects) == pytest.approx(1, abs=0.1)
    assert metrics.flicker(sources, restless, subjects) == pytest.approx(3, abs=0.3)
    assert np.isnan(metrics.flicker(sources, sources, subjects))


def test_every_clip_has_a_click_and_a_name_of_its_own() -> None:
    assert len(set(clips.NAMES)) == len(clips.CLIPS)
    assert sum(clip.has_row for clip in clips.CLIPS) == 4
    assert {clip.kind for clip in clips.CLIPS} == {"person", "animal", "vehicle", "still"}


def test_the_table_names_every_clip_of_the_data(data: Path) -> None:
    assert clips.files(data) <= {clip.path for clip in clips.CLIPS}


def test_every_click_is_on_its_subject(data: Path) -> None:
    for clip in clips.CLIPS:
        subject = clip.subject(clip.middle)
        height, width = subject.shape
        x, y = clip.click
        assert subject[int(y * height), int(x * width)], clip.name
        assert 0.002 < subject.mean() < 0.6, clip.name


def test_every_frame_of_a_row_has_its_subject(data: Path) -> None:
    for clip in clips.CLIPS:
        for frame in clip.row if clip.has_row else ():
            is_drawn = frame in clips.OUTLINES.get(clip.name, {})
            assert is_drawn or clip.drawn_mask(frame) is not None, (clip.name, frame)
            assert 0.005 < clip.subject(frame).mean() < 0.3, (clip.name, frame)


def test_a_command_that_fails_is_a_result(tmp_path: Path) -> None:
    words = ("-c", "import sys; print('began'); sys.exit('error: the clip only pans')")
    ended = commands.run(words, tmp_path / "log")
    assert (ended.status, ended.said, ended.message) == (1, "began", "the clip only pans")


def test_the_first_file_divides_the_processor_time(tmp_path: Path) -> None:
    first = tmp_path / "first"
    code = (
        "import sys, time, pathlib\n"
        "def burn(s):\n    end = time.process_time() + s\n    while time.process_time() < end: pass\n"
        f"burn(0.3); pathlib.Path({str(first)!r}).touch(); burn(0.6)"
    )
    ended = commands.run(("-c", code), tmp_path / "log", first)
    assert ended.first_cpu_s is not None
    assert 0.25 < ended.first_cpu_s < ended.cpu_s - 0.3


def test_what_is_kept_is_not_run_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A refused solve is kept; one that was ended by a signal is not, nor one of another click."""
    (tmp_path / "clip.mp4").write_bytes(b"clip")
    monkeypatch.setattr(clips, "DATA", tmp_path)
    monkeypatch.setattr(stages, "BUILD", tmp_path / "build")
    ran = []
    status = 130

    def run(words: object, log: Path, first: Path | None = None) -> Ended:
        ran.append(words)
        return replace(ENDED, status=status, message="no")

    monkeypatch.setattr(commands, "run", run)
    clip = clips.RealClip("clip.mp4", "still", (0.5, 0.5), clips.corners("0,0 9,0 9,9"))
    steps = stages.Steps(clip, stages.Program(commands.HEADLESS))
    assert steps.solve(run=False) is None
    steps.solve()
    status = 1
    for _ in range(2):
        found = stages.Steps(clip, stages.Program(commands.HEADLESS)).solve()
        assert found is not None and found.message == "no"
    assert len(ran) == 2
    row = scores.taken(steps, with_row=True)
    assert row.failure == "no" and not row.is_rendered and len(ran) == 2
    (tmp_path / "clip.mp4").write_bytes(b"another")
    stages.Steps(clip, stages.Program(commands.HEADLESS)).solve()
    assert len(ran) == 3


def test_a_row_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = clips.CLIPS[0]
    clicked = replace(ENDED, cpu_s=30.0, first_cpu_s=20.0)
    detail, noise = metrics.Detail(0.9, 0.1, 0.2), metrics.Noise(0.3, 3.6)
    row = Row(clip, ENDED, clicked, ENDED, ENDED, detail, 0.4, (0.8, 0.3), noise, 1.5, 0.75)
    refused = Row(clips.CLIPS[1], replace(ENDED, status=1, message=f"{clips.DATA}/clips/a pans"), *[None] * 3)
    program = stages.Program(commands.HEADLESS)
    monkeypatch.setattr(clips.RealClip, "near_middle", (1, 2, 3))
    monkeypatch.setattr(table, "SEEN", {program.commit: {clip.name: "whole, no halo"}})
    text = table.table([row, refused, Row(clips.CLIPS[2], *[None] * 4)], program)
    assert (
        f"| {clip.name} | person | solved | 10 | 20 | 5 | 0.90 | 0.40 | 0.10 | 0.20 | 0.80 / 0.30 |"
        " 0.30 -> 3.60* | 1.50 | 0.75 | whole, no halo |"
    ) in text
    assert "**not solved**: a pans" in text and str(clips.DATA) not in text
    assert "**not run**" in text
    assert (
        "2 of 3 clips were run. 1 were not solved; of 1 clicks 0 were refused. All commands took 70" in text
    )
    assert f"Noisier than the source with the dither: {clip.name}" in text


def test_a_cell_of_a_sheet_shows_the_whole_picture(source: metrics.Pixels) -> None:
    upright = np.ascontiguousarray(source.transpose(1, 0, 2))
    cell = sheet._titled(upright, "a title")
    assert cell.shape == (sheet.CELL[1] + sheet.LINE, sheet.CELL[0], 3)
    assert cell[: sheet.LINE].any() and cell[sheet.LINE :].any(axis=(1, 2)).all()
    assert not cell[sheet.LINE :, 301:].any()
