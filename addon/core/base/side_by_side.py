"""Parallel work on many items."""

from _thread import allocate_lock
from collections.abc import Callable, Iterable

from .limits import threads
from .progress import in_this_scope

Lock = allocate_lock
"""Makes a lock for data that calls side by side share. It starts no thread."""


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
    # Blender's process does not come here while a window shows the preview.
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads()) as pool:
        return list(pool.map(in_this_scope(work), things))
