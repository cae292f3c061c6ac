"""Waiting for a condition, however busy the machine is."""

from __future__ import annotations

import time
from collections.abc import Callable

PATIENCE = 600.0
"""Seconds until a test gives up: a hundred times the longest wait on two idle cores."""


def until(is_so: Callable[[], object], what: str = "", every: float = 0.02) -> None:
    """Wait until a condition holds, asking `every` so many seconds; AssertionError after `PATIENCE`."""
    end = time.monotonic() + PATIENCE
    while not is_so():
        assert time.monotonic() < end, f"not within {PATIENCE:g} s: {what or is_so}"
        time.sleep(every)
