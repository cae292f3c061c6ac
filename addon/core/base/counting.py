"""Counts in messages."""

from __future__ import annotations


def counted(count: int, singular: str, plural: str = "") -> str:
    """`count` and its noun: "1 vertex", "2 vertices"; without a plural the singular gets an s."""
    return f"{count} {singular if count == 1 else plural or f'{singular}s'}"
