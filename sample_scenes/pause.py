"""A person who walks, stands for twenty frames, and goes on: what moves is not what moves all the time."""

from __future__ import annotations

import numpy as np

from . import textures
from .figure import STANCE, STRIDE, Clothes, Walk, person, striding
from .park import AIR, SUN, park
from .stage import Stage, handheld
from .stroller import beside
from .textures import Generator

SEED = 139
FOCAL = 1.0
FRAMES = 70
STANDS = (25, 45)
"""The first and the last frame, counted from 0, in which the person stands."""


def stage() -> Stage:
    """A person at 4.4 m walks to the left and stands in the middle, both feet on the ground."""
    cameras = handheld(
        (0.45, 0, 1.38), (-0.45, 0.05, 1.34), (0.35, 4.4, 0.98), (-0.35, 4.4, 0.98), FOCAL, SEED, FRAMES
    )
    surroundings, body, cloth = np.random.default_rng(SEED).spawn(3)
    # A tenth of a stride both feet are on the ground: the pause is in its middle.
    begin = STRIDE * ((STANCE - 0.5) / 2 + 1) - striding(FRAMES, 2.4, 0.0, STANDS)[STANDS[0]]
    walk = Walk((1.2, 4.4), 180.0, striding(FRAMES, 2.4, begin, STANDS))
    things = (*park(surroundings), *person(body, "walker", walk, red_clothes(cloth), layer=2))
    return Stage(
        "pause", "a person who stops and goes on", cameras, things, focus=beside(walk), air=AIR, sun=SUN
    )


def red_clothes(rng: Generator) -> Clothes:
    """A jacket of the roofs' and roses' reds, blue trousers, black hair."""
    jacket = textures.cloth(rng, (256, 256), (0.62, 0.24, 0.18), (0.36, 0.14, 0.12))
    trousers = textures.speckled(rng, (128, 64), (0.16, 0.22, 0.34), (0.36, 0.44, 0.56))
    return Clothes(jacket, trousers, (0.80, 0.78, 0.74), ((0.05, 0.05, 0.06), (0.24, 0.20, 0.18)))
