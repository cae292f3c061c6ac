"""Reuse of the memory of large arrays from frame to frame."""

import math
import sys

import numpy as np

from .arrays import Map

OURS = 2
"""References to an unused array: this object's and that of `sys.getrefcount`."""


class ReusedMemory:
    """Makes arrays in the memory of the last one, if it is no longer referenced; not for several threads.

    The system hands out large arrays page by page: 0.37 instead of 0.004 CPU s for 150 MB (a virtual
    machine).
    """

    def __init__(self) -> None:
        self._kept = np.zeros(0, np.float32)

    def zeros(self, shape: tuple[int, ...]) -> Map:
        """Return zeros of a shape."""
        count = math.prod(shape)
        if self._kept.size < count or sys.getrefcount(self._kept) > OURS:
            self._kept = np.zeros(count, np.float32)
        else:
            self._kept[:count] = 0
        return self._kept[:count].reshape(shape)
