"""Memory for a large array that frame after frame needs."""

from __future__ import annotations

import math
import sys

import numpy as np

from .arrays import Map

OURS = 2
"""References to an array that only this keeps: its own, and that of `sys.getrefcount`."""


class ReusedMemory:
    """Arrays in the memory of the last one, once nobody holds that any more.

    The system hands out large arrays page by page, at more than it costs to fill them: 0.37 against 0.004 CPU
    s for 150 MB (a virtual machine; scratch script). Not for several threads.
    """

    def __init__(self) -> None:
        self._kept = np.zeros(0, np.float32)

    def zeros(self, shape: tuple[int, ...]) -> Map:
        """Zeros of a shape, float32."""
        count = math.prod(shape)
        if self._kept.size < count or sys.getrefcount(self._kept) > OURS:
            self._kept = np.zeros(count, np.float32)
        else:
            self._kept[:count] = 0
        return self._kept[:count].reshape(shape)
