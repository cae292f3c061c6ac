"""Parallel work on many items."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

from .limits import threads
from .progress import in_this_scope


def side_by_side[T, R](work: Callable[[T], R], things: Iterable[T]) -> list[R]:
    """Apply `work` to each item in threads, and return the results in order.

    Checkpoints report to the caller's scope; the first error ends the work. With one thread, the caller does
    the work, as passing an item to a thread takes 0.1 ms.

    >>> side_by_side(abs, [-1, 2])
    [1, 2]
    """
    things = list(things)
    if min(threads(), len(things)) < 2:
        return [work(each) for each in things]
    with ThreadPoolExecutor(threads()) as pool:
        return list(pool.map(in_this_scope(work), things))
