"""The lens as it is told on the command line, and what is said of it."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.focus.focus import Focus, largest_discs
from addon.core.media.light import encode_srgb, to_linear

from ..scenes import LENS, slanted_plane, write_frames
from .solved_clips import FRAMES, imported, run, work

__all__ = ["work"]


@pytest.mark.parametrize(("blur", "meant"), [("3", "for 3% write 0.03"), ("1", "for 1% write 0.01")])
def test_a_blur_in_per_cent_is_refused_with_what_was_meant(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], blur: str, meant: str
) -> None:
    lens = ("--focus-distance", 6, "--method", "features", "--blur", blur)
    assert run("render", work, *lens, "--out", tmp_path / "o" / "####.png") == 1
    said = capsys.readouterr().err
    assert f"the blur is {blur}, which is {blur}00% of the image width" in said and meant in said
    assert not (tmp_path / "o").exists()


def test_a_blur_too_large_for_layers_says_so_before(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lens = ("--focus-distance", 12, "--aperture-radius", 3, "--frames", 2)
    assert run("render", work, *lens, "--out", tmp_path / "o" / "####.png") == 0
    said = capfd.readouterr().out
    assert "too large for layers in 1 frame (2), which are drawn with features" in said
    assert said.index("too large") < said.index("frame 2: 1 of 1")


def test_a_place_is_in_the_frame_that_is_asked_for(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = ("--method", "features", "--focus-at", "0.5,0.5")
    assert run("inspect", work, "--frame", 5, *at, "--out", tmp_path / "i") == 0
    assert "away at frame 5, from points" in capsys.readouterr().out
    assert run("render", work, "--frames", "3-4", *at, "--out", tmp_path / "o" / "####.png") == 0
    assert "away at frame 3, from points" in capsys.readouterr().out
    assert (
        run("render", work, "--frames", "3-4", *at[:-1], "0.5,0.5@2", "--out", tmp_path / "p" / "####.png")
        == 0
    )
    assert "away at frame 2, from points" in capsys.readouterr().out


def test_a_quality_says_how_many_views_there_are_and_goes_to_other_processes(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lens = ("--focus-distance", "6", "--blur", "0.1", "--frames", "2", "--method", "features")
    counts = {}
    for quality in ("draft", "normal", "final"):
        report, out = tmp_path / f"{quality}.json", tmp_path / quality / "####.png"
        # What they are not told would be normal.
        command = ["render", str(work), *lens, "--out", str(out), "--quality", quality]
        command += ["--jobs", "1" if quality == "normal" else "2"]
        assert run_command([*command, "--report", str(report)]) == 0
        (frame,) = json.loads(report.read_text())["frames"]
        counts[quality] = frame["views"]
    assert counts["draft"] < counts["normal"] < counts["final"]
    command = ["render", str(work), *lens, "--out", str(tmp_path / "draft" / "####.png")]
    assert run_command(command) == 1
    assert "made from other inputs" in capsys.readouterr().err
    assert run_command([*command, "--quality", "draft"]) == 0


def test_discs_before_and_behind_are_said(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lens = ("--focus-distance", 8, "--blur", 0.01, "--method", "features")
    assert run("inspect", work, "--frame", 2, *lens, "--out", tmp_path / "i") == 0
    shot = slanted_plane(LENS, FRAMES, count=1500)
    front, behind = largest_discs(shot, Focus(distance=8.0), 2, 1.0)
    # The blur is that of the clip's first frame, whichever is shown.
    radius = 0.01 / largest_discs(shot, Focus(distance=8.0), 1, 1.0)[1]
    # Twice what was asked for of the background.
    assert front > 1.5 * behind
    said = capsys.readouterr().out
    before, after = (
        f"{160 * side:.1f} px ({100 * side:.1f}% of the width)" for side in (radius * front, radius * behind)
    )
    assert f"at frame 2: {before} in front of the focus, {after} behind it" in said
    assert "sharp at frame 2:" in said


def test_a_lamp_becomes_a_brighter_disc_unless_highlights_are_off(registered: None, tmp_path: Path) -> None:
    footage = write_frames(tmp_path / "clip", LENS, FRAMES)
    for file in sorted(footage.iterdir()):
        picture = cv2.imread(str(file))
        picture[20:70, 50:110] //= 8
        # Thirty times as bright as white, as a camera records it: a disc in white would be white paint.
        covered = np.zeros(picture.shape[:2], np.uint8)
        cv2.circle(covered, (16 * 80, 16 * 45), 20, 255, -1, cv2.LINE_AA, 4)
        lamp = cv2.GaussianBlur(covered.astype(np.float32) / 255, (0, 0), 0.5)
        seen = to_linear(picture)[..., :3] + 30 * lamp[..., None]
        cv2.imwrite(str(file), np.rint(255 * encode_srgb(np.minimum(seen, 1))).astype(np.uint8))
    work = imported(tmp_path, footage)
    lens = ("--focus-distance", 5, "--blur", 0.08, "--method", "features", "--frames", 3)
    light = []
    for number, highlights in enumerate([("--highlights", "off"), (), ("--highlights", "3")]):
        out = tmp_path / str(number)
        words = ["render", work, *lens, *highlights, "--views", 24, "--out", out / "####.png"]
        assert run_command([str(each) for each in words]) == 0
        drawn = to_linear(cv2.imread(str(out / "0003.png")))[36:54, 71:89, :3]
        light.append(float(drawn.sum()))
    assert light[0] < 0.95 * light[1] < 0.9 * light[2]


def test_exr_has_no_grain_unless_it_is_asked_for(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lens = ("--focus-distance", 6, "--blur", 0.02, "--method", "features", "--frames", 2)
    for suffix, default, other in ((".png", 1, "off"), (".exr", "off", 1)):
        out = tmp_path / suffix / f"####{suffix}"
        assert run("render", work, *lens, "--out", out) == 0
        assert run("render", work, *lens, "--grain", default, "--out", out) == 0
        assert "1 frame there already" in capfd.readouterr().out
        assert run("render", work, *lens, "--grain", other, "--out", out) == 1
        assert "made from other inputs" in capfd.readouterr().err
