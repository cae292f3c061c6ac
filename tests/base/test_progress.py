"""Progress through nested stages, over threads, and cancelling."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from addon.core.base.progress import Cancelled, checkpoint, in_this_scope, part, reporting, stage


def test_nested_stages_are_shares_of_the_whole() -> None:
    reports: list[tuple[str, float]] = []
    with reporting(lambda name, share: reports.append((name, round(share, 3)))):
        with stage("Depth", 0.2, 0.6):
            for number in range(2):
                with part(number, 2):
                    checkpoint(0.5)
        with stage("Views", 0.6, 1.0):
            checkpoint(1.0)
        checkpoint(1.0)
    depth = [("Depth", share) for share in (0.2, 0.2, 0.3, 0.4, 0.5)]
    assert reports == [*depth, ("Views", 0.6), ("Views", 1.0), ("", 1.0)]


def test_cancelling_leaves_no_scope_behind() -> None:
    def stop(name: str, share: float) -> None:
        raise Cancelled

    with pytest.raises(Cancelled), reporting(stop), stage("Depth", 0, 1):
        pass
    checkpoint()


def test_threads_take_part_in_the_scope() -> None:
    reports: list[str] = []

    @in_this_scope
    def work(number: int) -> int:
        checkpoint()
        return number

    with reporting(lambda name, share: reports.append(name)):
        # Made outside of the scope, so it does not take part.
        with ThreadPoolExecutor(2) as pool:
            assert list(pool.map(work, range(4))) == [0, 1, 2, 3]
        assert reports == []
        with stage("Depth", 0, 1), ThreadPoolExecutor(2) as pool:
            reports.clear()
            list(pool.map(in_this_scope(checkpoint), [0.5] * 4))
    assert reports == ["Depth"] * 4
