"""The same work on many things, by as many threads as the user allows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

from .limits import threads
from .progress import in_this_scope


def side_by_side[T, R](work: Callable[[T], R], things: Iterable[T]) -> list[R]:
    """Return the results of `work` on each thing, in their order.

    Checkpoints in it are those of the caller; the first error ends it. With one thread, the caller does the
    work: handing a thing to another thread takes 0.1 ms.

    >>> side_by_side(abs, [-1, 2])
    [1, 2]
    """
    things = list(things)
    if min(threads(), len(things)) < 2:
        return [work(each) for each in things]
    with ThreadPoolExecutor(threads()) as pool:
        return list(pool.map(in_this_scope(work), things))
