"""Calls of functions in another process: results, errors, cancelling and the end of the process."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from addon.core.base.calls import Failed
from addon.core.base.errors import UserError
from addon.core.base.progress import Cancelled
from addon.core.base.worker import Ended, Worker, end
from addon.core.media.clip import describe, open_footage

from ..waiting import until

SERVE = """
from addon.core.base import calls, messages, progress
def wait():
    with progress.stage("Waiting", 0.25, 0.25):
        calls.show("begun")
        while True:
            progress.checkpoint()
calls.wait = wait
wait.__module__ = calls.__name__
messages.speak()
calls.serve()
"""
"""A process that also has a function which ends when it is cancelled."""


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch) -> Iterator[Worker]:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    worker = Worker("helper")
    worker.start([sys.executable, "-c", SERVE], environment=os.environ)
    yield worker
    end([worker])


def wait() -> None:
    """Stands for the other process's own."""


wait.__module__, wait.__qualname__ = "addon.core.base.calls", "wait"


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> None:
    from addon.core.base import calls

    monkeypatch.setattr(calls, "wait", wait, raising=False)


def test_calls_are_answered_in_order(worker: Worker) -> None:
    first, second = worker.call(partial(describe, (7,))), worker.call(partial(describe, (1, 2, 3)))
    until(lambda: worker.poll() is not None and second.ended)
    assert first.ended and (first.result(), second.result()) == ("frame 7", "frames 1 to 3")
    assert not worker.calls and not [*worker.folder.iterdir()]


def test_errors_come_back(worker: Worker, tmp_path: Path) -> None:
    missing, bug = (
        worker.call(partial(open_footage, tmp_path / "gone.mp4")),
        worker.call(partial(describe, 7)),
    )
    until(lambda: worker.poll() is not None and bug.ended)
    with pytest.raises(UserError, match="does not exist"):
        missing.result()
    with pytest.raises(Failed) as caught:
        bug.result()
    text, trace = caught.value.args
    assert text.startswith("TypeError: ") and "in describe" in trace


def test_a_cancelled_call_ends_before_the_next(worker: Worker, waits: None) -> None:
    first, second, third = worker.call(wait), worker.call(wait), worker.call(partial(describe, (1,)))
    until(lambda: worker.poll() is not None and first.shown and first.share)
    assert (first.shown, first.stage, first.share, first.ended) == (["begun"], "Waiting", 0.25, False)
    # The other way round the second one may begin between the two.
    second.cancel()
    first.cancel()
    until(lambda: worker.poll() is not None and third.ended)
    assert third.result() == "frame 1" and second.shown == []
    assert not [*worker.folder.iterdir()]
    for each in (first, second):
        with pytest.raises(Cancelled):
            each.result()


def test_the_end_of_the_process_ends_its_calls(worker: Worker, waits: None) -> None:
    calls = [worker.call(wait), worker.call(wait)]
    until(lambda: worker.poll() is not None and calls[0].shown)
    assert worker.process is not None
    worker.process.kill()
    until(lambda: worker.poll() is not None and calls[1].ended)
    for each in calls:
        with pytest.raises(Ended, match="the helper was ended by SIGKILL"):
            each.result()
