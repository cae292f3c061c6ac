"""A camera on a tripod turns after someone who walks: no parallax, but all that they hide is seen."""

from __future__ import annotations

from .park import AIR, SUN
from .stage import Stage
from .stroller import beside, green_clothes
from .tripod import filmed, turning, walk

SEED = 151
TURN = 16.0
"""Degrees, while who walks goes 37: they cross the picture, too, and more slowly."""


def stage() -> Stage:
    """A person at 4 m walks to the right and is in focus."""
    path = walk(2.7)
    return Stage(
        "pan", "a camera that only turns after a person who walks", turning(TURN),
        tuple(filmed(SEED, path, green_clothes)), focus=beside(path), air=AIR, sun=SUN,
    )  # fmt: skip
