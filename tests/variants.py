"""Variants of a test: a few for `make test`, all for `make test-all`."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import pytest


def variants(values: Iterable[object], often: int) -> list[object]:
    """Values for `pytest.mark.parametrize`; those after the first `often` are marked `long`."""
    return [
        value if place < often else pytest.param(value, marks=pytest.mark.long)
        for place, value in enumerate(values)
    ]


def combined(*axes: Iterable[object]) -> list[object]:
    """All combinations of values, one of each axis, for `pytest.mark.parametrize`; of a dict its values, by
    their names. So many that each value is there once are for `make test`, the others are marked `long`."""
    named = [
        list(axis.items()) if isinstance(axis, dict) else [(str(value), value) for value in axis]
        for axis in axes
    ]
    often = {tuple(place % len(axis) for axis in named) for place in range(max(map(len, named)))}
    made = []
    for places in product(*(range(len(axis)) for axis in named)):
        names, values = zip(*(axis[place] for axis, place in zip(named, places, strict=True)), strict=True)
        marks = () if places in often else pytest.mark.long
        made.append(pytest.param(*values, id="-".join(names), marks=marks))
    return made
