"""Caches of the values of recent frames."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, Concatenate

from .side_by_side import Lock

MOST = 64
"""Values that are remembered by default: small results of the frames around one."""


class LRUCache[V]:
    """Values by frame or another key; drops the least recently used, but never the last.

    Two threads that ask for a value at once may both make it. `limit` bounds the sum of the values' sizes.
    """

    def __init__(self, limit: float = MOST, size: Callable[[V], int] = lambda value: 1) -> None:
        self._limit, self._size = limit, size
        self._kept: OrderedDict[Hashable, V] = OrderedDict()
        self._held = 0
        """Sum of the values' sizes."""
        self._lock = Lock()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._kept

    def known(self, key: Hashable) -> V | None:
        """Return the value of a key, or None."""
        with self._lock:
            return self._kept.get(key)

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """Return the value of a key, made if necessary."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        # Outside the lock: making may take seconds, and use other caches.
        value = make()
        with self._lock:
            if key in self._kept:
                self._held -= self._size(self._kept.pop(key))
            self._kept[key] = value
            self._held += self._size(value)
            while len(self._kept) > 1 and self._held > self._limit:
                self._held -= self._size(self._kept.popitem(last=False)[1])
        return value


def remembered[S, **P, V](
    limit: float = MOST, size: Callable[[Any], int] = lambda value: 1
) -> Callable[[Callable[Concatenate[S, P], V]], Callable[Concatenate[S, P], V]]:
    """Have an object remember the last results of a method by their arguments, as an `LRUCache` does."""

    def of(method: Callable[Concatenate[S, P], V]) -> Callable[Concatenate[S, P], V]:
        name = f"{method.__name__} remembered"

        @wraps(method)
        def get(thing: S, /, *args: P.args, **named: P.kwargs) -> V:
            kept: LRUCache[V] | None = vars(thing).get(name)
            if kept is None:
                kept = vars(thing).setdefault(name, LRUCache[V](limit, size))
            return kept.get((args, *named.items()), lambda: method(thing, *args, **named))

        return get

    return of
