"""Variants of a test: a few for `make test`, all for `make test-all`."""

from __future__ import annotations

from collections.abc import Iterable

import pytest


def variants(values: Iterable[object], often: int) -> list[object]:
    """Values for `pytest.mark.parametrize`; those after the first `often` are marked `long`."""
    return [
        value if place < often else pytest.param(value, marks=pytest.mark.long)
        for place, value in enumerate(values)
    ]
