"""What the benchmarks of speed make of what they measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import envelope
from benchmarks.accuracy.envelope import Curve
from benchmarks.accuracy.rows import Row
from benchmarks.accuracy.scenes import Resized
from benchmarks.timings import frame_costs, speed, whole_runs


def row(method: str, views: int, cost: float, error: float) -> Row:
    return Row("bars", "T1", method, views, 32, 1, "", 40.0, psnr=20.0, unclipped_psnr=error, cpu_s=cost)


def test_an_envelope_tells_where_others_are_above() -> None:
    ours = [row("layers", 8, 1.0, 36.0), row("layers", 4, 1.5, 35.0), row("draft", 0, 0.2, 34.0)]
    below = [row("scatter", 0, 0.3, 33.9), row("thesis", 64, 2.0, 36.0)]

    def said(*rows: Row) -> str:
        return Curve("bars", "T1", (640, 360), rows).envelope

    assert "every cost" in said(*ours, *below)
    above = said(*ours, row("scatter", 0, 0.3, 34.5), row("thesis", 4, 0.1, 20.0))
    assert "scatter: 0.50 dB above ours at 0.30 s" in above
    assert "thesis 4: 20.00 dB for 0.10 s, less than any of ours takes" in above


def test_a_curve_replaces_its_own_panel_alone(tmp_path: Path) -> None:
    for track, width, error in (("T1", 1920, 30.0), ("T1", 640, 31.0), ("T2", 640, 32.0), ("T1", 640, 33.0)):
        rows = row("layers", 8, 1.0, error), row("scatter", 0, 0.5, 20.0)
        envelope.put(tmp_path, Curve("bars", track, (width, width * 9 // 16), rows))
    text = (tmp_path / "envelope.md").read_text()
    assert [line.split(",")[1] for line in text.splitlines() if line.startswith("## ")] == [
        " 640x360", " 640x360", " 1920x1080"
    ]  # fmt: skip
    assert "33.00" in text and "31.00" not in text and (tmp_path / "envelope.png").exists()


def test_a_resized_scene_has_the_same_view_and_blur_in_shares_of_the_width() -> None:
    small, large = Resized("walk", 0.1, 640), Resized("walk", 0.1, 3840)
    one, other = small.stage.cameras, large.stage.cameras
    assert (other.width, other.height) == (3840, 2160)
    assert other.focal / other.width == pytest.approx(one.focal / one.width)
    assert [small._samples(frame) for frame in (1, 18)] == [16, 16]
    assert [large._samples(frame) for frame in (1, 18)] == [4, 16]


def test_a_part_is_put_in_its_place_and_others_stay(tmp_path: Path) -> None:
    file = tmp_path / "speed.md"
    names = list(speed.PARTS)
    for name in (names[3], names[1], names[3]):
        speed.put(file, name, f"commit of {name}.\n\n| a |\n")
    text = file.read_text()
    assert text.startswith(speed.TITLE) and text.count("## ") == 2
    assert text.index(f"## {names[1]}\n") < text.index(f"## {names[3]}\n")
    speed.put(file, names[1], "anew")
    assert "anew" in file.read_text() and f"commit of {names[1]}." not in file.read_text()
    assert f"commit of {names[3]}.\n\n| a |" in file.read_text()


def test_a_frame_costs_what_more_frames_cost_more() -> None:
    runs = whole_runs.Run(5.0, 8.0, 300.0), whole_runs.Run(11.0, 20.0, 320.0)
    assert whole_runs.a_frame(runs, 6) == pytest.approx((1.0, 2.0))
    assert np.isclose(whole_runs.parsed("640x360"), (640, 360)).all()


def test_stages_that_are_timed_exist() -> None:
    missing = [(owner, name) for owner, name, _ in frame_costs.STAGES if not hasattr(owner, name)]
    assert not missing
