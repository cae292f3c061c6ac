"""Numbers in the notation of people and other programs.

Python's `int` and `float` accept more: `nan`, `inf`, `1_000`, the digits of every script, and 1e400 as
infinity. No other program writes those, and they are typing errors of a user.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e15
"""No number is larger, in any unit: its fourth power is far from overflow, and it fits a 32-bit float."""
LARGEST_WHOLE = 2**31 - 1
"""Largest whole number that Blender keeps."""
_REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_WHOLE = re.compile(r"[+-]?\d{1,400}", re.ASCII)


def real(text: str) -> float:
    """A finite decimal number; ValueError for anything else."""
    value = float(text) if _REAL.fullmatch(text) else math.inf
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is not a number")
    return value


def whole(text: str) -> int:
    """A whole decimal number of any size; ValueError for anything else."""
    if not _WHOLE.fullmatch(text):
        raise ValueError(f"{text!r} is not a whole number")
    return int(text)


def reals(words: Sequence[bytes]) -> NDArray[np.float64]:
    """(n,) of n words of a file, `nan` and infinities among them; ValueError where one is no number."""
    _refuse_underscores(words)
    return np.fromiter(map(float, words), np.float64, len(words))


def wholes(words: Sequence[bytes]) -> NDArray[np.int64]:
    """(n,) of n words of a file; ValueError where one is no whole number, OverflowError beyond 63 bits."""
    _refuse_underscores(words)
    return np.fromiter(map(int, words), np.int64, len(words))


def _refuse_underscores(words: Sequence[bytes]) -> None:
    # Python reads only ASCII digits from bytes, so this is all that is left to refuse.
    if b"_" in b" ".join(words):
        raise ValueError("a word has an underscore")
