"""Drawing in slices on the main thread: the picture, errors and cancelling. (With a window: by hand.)"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from addon.core.base.progress import Cancelled, reporting
from addon.render.views.gpu_views import gpu_problem
from addon.scene.gpu import main_thread
from addon.scene.gpu.main_thread import Steps, _Job

PICTURE = np.ones((2, 2, 4), np.float32)


def steps(count: int, closed: list[bool], error: Exception | None = None) -> Steps:
    try:
        yield from range(count)
        if error is not None:
            raise error
        return PICTURE
    finally:
        closed.append(True)


@pytest.fixture(autouse=True)
def _nothing_left() -> Iterator[None]:
    assert not gpu_problem()
    yield
    main_thread.stop()


def ticked(job: _Job) -> _Job:
    main_thread._waiting.append(job)
    for _ in range(1000):
        main_thread._tick()
        if job.ended:
            return job
    raise AssertionError("the job never ended")


def test_a_drawing_is_finished_in_slices() -> None:
    job = ticked(_Job(steps(5000, closed := [])))
    assert job.made == [PICTURE] and job.done == 4999 and closed == [True]


def test_an_error_is_handed_to_the_thread_that_waits() -> None:
    job = ticked(_Job(steps(3, [], ValueError("lost"))))
    assert not job.made and str(job.error) == "lost"


def test_a_cancelled_drawing_lets_go_of_the_gpu() -> None:
    job = _Job(steps(10**9, closed := []))
    main_thread._waiting.append(job)
    main_thread._tick()
    assert job.done > 0 and not job.ended
    job.is_cancelled = True
    main_thread._tick()
    assert job.ended and closed == [True] and not job.made
    assert main_thread._tick() == main_thread.IDLE


def test_without_a_window_it_is_drawn_at_once() -> None:
    shares: list[float] = []
    with reporting(lambda stage, share: shares.append(share)):
        assert main_thread.draw(steps(4, []), 4) is PICTURE
    assert shares == [0, 0.25, 0.5, 0.75]

    def stop(_stage: str, share: float) -> None:
        if share >= 0.5:
            raise Cancelled

    with reporting(stop), pytest.raises(Cancelled):
        main_thread.draw(steps(4, closed := []), 4)
    assert closed == [True]


def test_who_waits_for_a_drawing_that_is_dropped_is_told() -> None:
    job = _Job(steps(10**9, closed := []))
    main_thread._waiting.append(job)
    main_thread._tick()
    queued = _Job(steps(3, []))
    main_thread._waiting.append(queued)
    main_thread.stop()
    assert job.ended and queued.ended and closed == [True]


def test_a_drawing_waits_for_a_gpu_context(monkeypatch: pytest.MonkeyPatch) -> None:
    job = _Job(steps(3, closed := []))
    main_thread._waiting.append(job)
    monkeypatch.setattr(main_thread, "has_gpu_context", lambda: False)
    assert main_thread._tick() == main_thread.IDLE
    assert not job.ended and closed == []
    monkeypatch.undo()
    main_thread._tick()
    assert job.ended and job.made == [PICTURE]
