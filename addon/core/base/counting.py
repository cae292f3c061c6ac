"""Numbers and their nouns in messages."""

from collections.abc import Sequence
from itertools import pairwise


def counted(count: int, singular: str) -> str:
    """Format a count and its noun, whose plural appends an s: "1 frame", "2 frames"."""
    return f"{count} {singular}{'' if count == 1 else 's'}"


def ordinal(number: int) -> str:
    """Format a whole number above 0 as an ordinal: "1st", "12th"."""
    teens = 10 < number % 100 < 20
    return f"{number}{'th' if teens else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"


def common_step(frames: Sequence[int]) -> int:
    """Return the constant step of at least three increasing frames; 0 if the steps differ."""
    steps = {after - before for before, after in pairwise(frames)}
    return steps.pop() if len(frames) > 2 and len(steps) == 1 else 0


def ranges(frames: list[int]) -> str:
    """Format increasing frames as ranges: [1, 2, 3, 7] becomes "1-3, 7"."""
    spans: list[list[int]] = []
    for frame in frames:
        if spans and frame == spans[-1][1] + 1:
            spans[-1][1] = frame
        else:
            spans.append([frame, frame])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in spans)
