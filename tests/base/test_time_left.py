"""Estimates of the time left: none before they mean something, and none that jump."""

from __future__ import annotations

import time
from itertools import pairwise

import pytest

from addon.cli import solve
from addon.core.base.messages import Progress
from addon.core.base.time_left import Clock, TimeLeft
from addon.core.base.worker import Worker
from addon.core.sfm.process import SolveProgress
from addon.core.sfm.steps import SHARES


def test_what_is_tried_again_takes_no_part_and_is_not_told() -> None:
    left = TimeLeft(0.0)
    assert left.at(80, 0.8) == pytest.approx(20)
    # It falls back to three tenths, where 80 s were said to be 190 s left.
    assert [left.at(t, s) for t, s in ((81, 0.3), (100, 0.5), (150, 0.75))] == [None, None, None]
    # Past where it was, by the pace of before: 90 % in 90 s of work.
    assert left.at(160, 0.9) == pytest.approx(10, abs=1)


def test_the_line_of_a_solve_never_jumps(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr(solve.time, "monotonic", lambda: now[0])
    line, job = solve._ProgressLine(), Worker()
    low, high = SHARES["Solving cameras"]
    estimates: list[tuple[float, float | None]] = []
    # Three tries of the cameras, the first two given up near their end.
    for share in (0.1, low, high - 0.01, low, high - 0.01, low, high, 0.95, 0.99):
        now[0] += 30
        job._progressed(Progress(f"Stage{share}", 1, 2, share=share))
        line.show(SolveProgress(f"Stage{share} 1/2", share, job.left))
        said = capsys.readouterr().out
        estimates.append((now[0], float(said.split("about ")[1].split()[0]) if "left" in said else None))
    assert sum(left is not None for _, left in estimates) >= 3
    for (before, one), (after, other) in pairwise(estimates):
        assert one is None or other is None or other <= 2 * max(one - (after - before), 0) + 6


def test_the_first_frame_tells_nothing_of_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    now, estimates = [0.0], []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    clock = Clock("frames", 5, estimates.append)
    for frame, seconds in ((11, 40.0), (12, 4.0), (13, 6.0), (14, 5.0), (15, 5.0)):
        now[0] += seconds
        clock.tick(frame)
    assert estimates == [
        "frame 11: 1 of 5, 40.0 s",
        "frame 12: 2 of 5, 4.0 s each, 0 min 12 s left",
        "frame 13: 3 of 5, 5.0 s each, 0 min 10 s left",
        "frame 14: 4 of 5, 5.0 s each, 0 min 05 s left",
        "frame 15: 5 of 5, 5.0 s each, 0 min 00 s left",
    ]
