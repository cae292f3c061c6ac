"""Frames of an animation that other processes draw ahead: the same pictures, whoever draws them."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from addon.core.base import calls, limits
from addon.core.base.progress import Cancelled, reporting
from addon.core.base.worker import Worker
from addon.render.processes.frames_ahead import DrawnFrame, FramesAhead

from ..waiting import until

DRAW = """
from pathlib import Path
from addon.core.base import calls, messages, progress
def draw(folder, frame):
    Path(folder, f"begun {frame}").touch()
    while not Path(folder, str(frame)).exists():
        progress.checkpoint()
    return frame
calls.draw = draw
draw.__module__ = calls.__name__
messages.speak()
calls.serve()
"""
"""A process whose frames are drawn once there is a file of their name."""


def draw(folder: str, frame: int) -> DrawnFrame:
    """Stands for the other process's own."""
    raise NotImplementedError


draw.__module__ = "addon.core.base.calls"


@pytest.fixture(autouse=True)
def _threads_as_before() -> Iterator[None]:
    before = limits.chosen_threads()
    yield
    limits.limit_threads(before)


@pytest.fixture
def ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[FramesAhead]:
    """One process that draws every second frame of twenty ahead."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    monkeypatch.setattr(calls, "draw", draw, raising=False)
    worker = Worker()
    worker.start([sys.executable, "-c", DRAW], environment=os.environ)
    made = FramesAhead([worker], str(tmp_path), range(0, 20, 2), draw)
    yield made
    made.end()


def test_frames_are_drawn_within_reach_of_the_one_under_way(ahead: FramesAhead, tmp_path: Path) -> None:
    for frame in range(20):
        (tmp_path / str(frame)).touch()
    # Nobody has begun with it.
    assert ahead.frame(2) is None
    until(lambda: ahead.workers[0].poll() is not None and not ahead.workers[0].calls)
    assert [*ahead._calls] == [4, 6] and not (tmp_path / "begun 8").exists()
    # As each view layer asks.
    assert ahead.frame(4) == ahead.frame(4) == 4
    assert [*ahead._calls] == [6, 8]
    # What Blender has passed is drawn by nobody.
    ahead.frame(16)
    until(lambda: ahead.workers[0].poll() is not None and not ahead.workers[0].calls)
    assert [*ahead._calls] == [18] and ahead.frame(18) == 18
    assert ahead._calls == {}


def test_one_draws_here_what_nobody_is_at_and_waits_for_what_somebody_is(
    ahead: FramesAhead, tmp_path: Path
) -> None:
    assert ahead.frame(2) is None
    until(lambda: ahead.workers[0].poll() is not None and ahead._calls[4].is_begun)
    looks = 0

    def look(_stage: str, _share: float) -> None:
        nonlocal looks
        looks += 1
        if looks > 5:
            raise Cancelled

    with pytest.raises(Cancelled), reporting(look):
        ahead.frame(4)
    # It goes on with the next one while this process is at another.
    (tmp_path / "4").touch()
    until((tmp_path / "begun 6").exists)
    process = ahead.workers[0].process
    assert process is not None and ahead.frame(4) == 4
    process.kill()
    process.wait()
    assert ahead.frame(6) is None and ahead._calls == {}
