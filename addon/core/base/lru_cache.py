"""Recent results by frame, so that neighbouring frames can share them."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable


class LRUCache[V]:
    """Values by frame, or another key; the least recently asked for are forgotten, the last one never.

    Several threads may ask; two that ask for the same value at once may both make it.
    """

    def __init__(self, limit: int, size: Callable[[V], int] = lambda value: 1) -> None:
        """At most `limit` of the sum of the values' sizes is kept."""
        self._limit, self._size = limit, size
        self._kept: OrderedDict[Hashable, V] = OrderedDict()
        self._lock = threading.Lock()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._kept

    def known(self, key: Hashable) -> V | None:
        """A key's value, None where it is not kept."""
        with self._lock:
            return self._kept.get(key)

    def get(self, key: Hashable, make: Callable[[], V]) -> V:
        """A key's value, made if need be."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        # Not in the lock: making may take seconds, and ask other caches.
        value = make()
        with self._lock:
            self._kept[key] = value
            self._kept.move_to_end(key)
            while len(self._kept) > 1 and sum(map(self._size, self._kept.values())) > self._limit:
                self._kept.popitem(last=False)
        return value
