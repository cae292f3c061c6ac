"""Calls of functions in another process: results, errors, cancelling and the end of the process."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from addon.core.base.calls import Caller, Ended, Failed
from addon.core.base.errors import UserError
from addon.core.base.job import Job, end
from addon.core.base.progress import Cancelled
from addon.core.media.clip import describe, open_footage

from ..waiting import until

SERVE = """
import sys
from pathlib import Path
from addon.core.base import calls, messages, progress
def wait():
    with progress.stage("Waiting", 0.25, 0.25):
        calls.show("begun")
        while True:
            progress.checkpoint()
calls.wait = wait
wait.__module__ = calls.__name__
messages.speak()
calls.serve(Path(sys.argv[1]))
"""
"""A process that also has a function which ends when it is cancelled."""


@pytest.fixture
def caller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Caller]:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    job = Job("helper")
    job.start([sys.executable, "-c", SERVE, str(tmp_path)], environment=os.environ)
    yield Caller(job, tmp_path)
    end([job])


def wait() -> None:
    """Stands for the other process's own."""


wait.__module__, wait.__qualname__ = "addon.core.base.calls", "wait"


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.core.base import calls

    monkeypatch.setattr(calls, "wait", wait, raising=False)


def test_calls_are_answered_in_order(caller: Caller, tmp_path: Path) -> None:
    first, second = caller.call(partial(describe, (7,))), caller.call(partial(describe, (1, 2, 3)))
    until(lambda: caller.poll() is None and second.ended)
    assert first.ended and (first.result(), second.result()) == ("frame 7", "frames 1 to 3")
    assert caller.is_idle and not [path for path in tmp_path.iterdir() if path.is_file()]


def test_errors_come_back(caller: Caller, tmp_path: Path) -> None:
    missing, bug = (
        caller.call(partial(open_footage, tmp_path / "gone.mp4")),
        caller.call(partial(describe, 7)),
    )
    until(lambda: caller.poll() is None and bug.ended)
    with pytest.raises(UserError, match="does not exist"):
        missing.result()
    with pytest.raises(Failed) as caught:
        bug.result()
    text, trace = caught.value.args
    assert text.startswith("TypeError: ") and "in describe" in trace


def test_a_cancelled_call_ends_before_the_next(caller: Caller, waits: None, tmp_path: Path) -> None:
    first, second, third = caller.call(wait), caller.call(wait), caller.call(partial(describe, (1,)))
    until(lambda: caller.poll() is None and first.shown and first.share)
    assert (first.shown, first.stage, first.share, first.ended) == (["begun"], "Waiting", 0.25, False)
    first.cancel()
    second.cancel()
    until(lambda: caller.poll() is None and third.ended)
    assert third.result() == "frame 1" and second.shown == []
    assert not [path for path in tmp_path.iterdir() if path.is_file()]
    for each in (first, second):
        with pytest.raises(Cancelled):
            each.result()


def test_the_end_of_the_process_ends_its_calls(caller: Caller, waits: None) -> None:
    calls = [caller.call(wait), caller.call(wait)]
    until(lambda: caller.poll() is None and calls[0].shown)
    assert caller.job.process is not None
    caller.job.process.kill()
    until(lambda: caller.poll() is None and calls[1].ended)
    for each in calls:
        with pytest.raises(Ended, match="the helper was ended by SIGKILL"):
            each.result()


def test_dropped_calls_are_cancelled(caller: Caller, waits: None) -> None:
    call = caller.call(wait)
    caller.drop()
    assert call.ended and caller.is_idle
    with pytest.raises(Cancelled):
        call.result()
