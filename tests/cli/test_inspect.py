"""Inspecting a frame, and reports of a run, on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest

from addon.core.frame.inspection import NAMES
from addon.core.frame.report import FrameReport

from ..command_line import done, here
from .solved_clips import PLANES_LENS, import_planes


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three planes, whose cameras are known."""
    return import_planes(tmp_path_factory.mktemp("known"))


LOOK = ("--focus-distance", 6, "--aperture-radius", 0.25, "--views", 8)


def test_inspect_writes_everything_and_overwrites_nothing(work: Path, tmp_path: Path) -> None:
    command = ("inspect", work, "--frame", 5, *LOOK, "--out", tmp_path / "seen")
    said = done(*command)
    files = [*(f"{name}.png" for name in NAMES), "report.json"]
    assert sorted(p.name for p in (tmp_path / "seen").iterdir()) == sorted(files)
    shapes = {name: cv2.imread(str(tmp_path / "seen" / f"{name}.png")).shape for name in NAMES}
    assert set(shapes.values()) == {(120, 160, 3)}
    report = json.loads((tmp_path / "seen" / "report.json").read_text())
    assert (report["frame"], report["method"], report["views"]) == (5, "layers", 8)
    assert report["sure"] > 80 and report["own"] > 80
    assert report["borrowed"] > report["inpainted"] > 0
    # The planes' discs: 2 R f (1/4 - 1/6) and 2 R f (1/6 - 1/10).
    assert report["blur_largest"] == pytest.approx(
        2 * 0.25 * PLANES_LENS.fx * (1 / 6 - 1 / 10 + 0.02), rel=0.5
    )
    assert f"{report['triangles']:,} triangles" in said and "% other frames'" in said
    (tmp_path / "seen" / "depth.png").unlink()
    again = here(*command)
    assert again.returncode == 1 and "pass --overwrite" in again.stderr
    assert not (tmp_path / "seen" / "depth.png").exists()
    done(*command, "--overwrite", "--method", "features")
    assert sorted(p.name for p in (tmp_path / "seen").iterdir()) == sorted(files)
    other = here("inspect", work, "--frame", 99, *LOOK, "--out", tmp_path / "none")
    assert other.returncode == 1 and "no frame 99; it has 1 to 9" in other.stderr
    assert not (tmp_path / "none").exists()


def test_a_sequence_and_its_report_go_on_together(work: Path, tmp_path: Path) -> None:
    render = ("render", work, *LOOK, "--out", tmp_path / "frames" / "####.png")
    report = tmp_path / "report.json"
    plain = done(*render, "--frames", "4")
    assert "1 frame drawn by layers: its depth is sure enough" in plain and "pixels:" not in plain
    said = done(*render, "--frames", "4-5", "--report", report)
    assert "1 frame drawn by layers: its depth is sure enough; pixels: " in said
    assert "no report for existing frames: 4" in said
    assert "2 frames drawn by layers" in done(*render, "--frames", "5-6", "--report", report)
    held = [FrameReport(**entry) for entry in json.loads(report.read_text())["frames"]]
    assert [one_.frame for one_ in held] == [5, 6]
    wider = (*LOOK[:3], 0.3, *LOOK[4:], "--frames", 6, "--report", report)
    other = here("render", work, *wider, "--out", tmp_path / "other" / "####.png")
    assert other.returncode == 1 and "other settings" in other.stderr
    assert [entry["frame"] for entry in json.loads(report.read_text())["frames"]] == [5, 6]
