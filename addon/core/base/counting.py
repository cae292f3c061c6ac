"""Counts in messages."""

from __future__ import annotations


def counted(count: int, singular: str, plural: str = "") -> str:
    """`count` and its noun: "1 vertex", "2 vertices"; without a plural the singular gets an s."""
    return f"{count} {singular if count == 1 else plural or f'{singular}s'}"


def ranges(frames: list[int]) -> str:
    """1, 2, 3, 7 -> "1-3, 7"."""
    spans: list[list[int]] = []
    for frame in frames:
        if spans and frame == spans[-1][1] + 1:
            spans[-1][1] = frame
        else:
            spans.append([frame, frame])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in spans)
