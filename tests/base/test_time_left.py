"""Estimates of the time left: none before they mean something, and none that jump."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
import pytest

from addon.cli import solve
from addon.core.base.messages import Progress
from addon.core.base.time_left import Advance, Clock
from addon.core.base.worker import Worker
from addon.core.sfm.process import SolveProgress
from addon.core.sfm.steps import SHARES


def test_a_bar_never_goes_back() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        advance = Advance()
        shown = [advance.to(share) for share in rng.uniform(0, 1, 20)]
        assert shown == sorted(shown) and shown[0] >= 0 and shown[-1] <= 1
        assert advance.to(1.0) == pytest.approx(1)


def test_a_retry_goes_on_from_where_the_bar_was() -> None:
    advance = Advance()
    shown = [advance.to(share) for share in (0.2, 0.4, 0.2, 0.6, 1.0)]
    assert shown == pytest.approx([0.2, 0.4, 0.4, 0.7, 1.0])


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
