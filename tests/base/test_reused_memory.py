"""Memory that is used again, but never under somebody's hands."""

from __future__ import annotations

import numpy as np

from addon.core.base.reused_memory import ReusedMemory


def test_memory_is_used_again_once_nobody_holds_it() -> None:
    memory = ReusedMemory()
    first = memory.zeros((4, 5, 3))
    place = first.ctypes.data
    first += 7
    del first
    again = memory.zeros((2, 9))
    assert again.ctypes.data == place
    assert again.shape == (2, 9) and again.dtype == np.float32 and not again.any()


def test_what_is_held_is_never_written_to() -> None:
    memory = ReusedMemory()
    held = memory.zeros((4, 5))[1:, ::2]
    held += 7
    other = memory.zeros((4, 5))
    assert not np.shares_memory(held, other)
    assert (held == 7).all() and not other.any()


def test_more_than_there_was() -> None:
    memory = ReusedMemory()
    memory.zeros((3,))
    assert memory.zeros((40, 2)).shape == (40, 2)
