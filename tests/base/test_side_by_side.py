"""Work on many things is in their order, and ends as the caller's does, with one thread and with more."""

from __future__ import annotations

import threading

import pytest

from addon.core.base import limits
from addon.core.base.progress import Cancelled, checkpoint, reporting
from addon.core.base.side_by_side import side_by_side


@pytest.mark.parametrize("threads", [1, 2])
def test_results_are_in_order(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    monkeypatch.setenv(limits.THREADS, str(threads))
    assert side_by_side(lambda n: 2 * n, range(50)) == list(range(0, 100, 2))
    assert side_by_side(abs, []) == []


def test_a_single_thread_is_the_callers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(limits.THREADS, "1")
    assert set(side_by_side(lambda _: threading.get_ident(), range(5))) == {threading.get_ident()}


@pytest.mark.parametrize("threads", [1, 2])
def test_it_can_be_cancelled_from_within(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    monkeypatch.setenv(limits.THREADS, str(threads))

    def stop(stage: str, share: float) -> None:
        raise Cancelled

    with reporting(stop), pytest.raises(Cancelled):
        side_by_side(lambda _: checkpoint(), range(5))
