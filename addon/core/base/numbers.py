"""Parsing of numbers from people and other programs.

Python's own `int` and `float` accept more: `nan`, `inf`, `1_000`, digits of every script, and 1e400 as
infinity.
"""

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e15
"""Largest number in any unit: its fourth power does not overflow, and it fits a 32-bit float."""
LARGEST_WHOLE = 2**31 - 1
"""Largest whole number that Blender stores."""
_REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_WHOLE = re.compile(r"[+-]?\d{1,400}", re.ASCII)


def real(text: str) -> float:
    """Parse a finite decimal number; raises ValueError."""
    value = float(text) if _REAL.fullmatch(text) else math.inf
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is not a number")
    return value


def whole(text: str) -> int:
    """Parse a whole decimal number of any size; raises ValueError."""
    if not _WHOLE.fullmatch(text):
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)


def reals(words: Sequence[bytes]) -> NDArray[np.float64]:
    """Parse n words of a file as (n,) numbers, including `nan` and infinity; raises ValueError."""
    # In bytes, Python accepts ASCII digits only, so that underscores alone remain.
    if b"_" in b" ".join(words):
        raise ValueError("a word has an underscore")
    return np.fromiter(map(float, words), np.float64, len(words))
