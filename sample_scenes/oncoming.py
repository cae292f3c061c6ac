"""A person and the camera walk towards each other: what moves agrees with the epipolar geometry."""

from __future__ import annotations

import numpy as np

from . import textures
from .figure import Clothes, Walk, person, striding
from .park import AIR, SUN, park
from .stage import Stage, handheld
from .stroller import beside
from .textures import Generator

SEED = 137
FOCAL = 1.0
FRAMES = 60
FACE = np.array([0.0, -0.13, 1.64])


def stage() -> Stage:
    """A person from 6.2 to 4.2 m, the camera from 0 to 1.1 m: 6.2 m apart at first, 3.1 m in the end."""
    cameras = handheld(
        (-0.06, 0, 1.42), (0.10, 1.1, 1.40), (0.0, 7.0, 1.05), (0.05, 7.0, 0.95), FOCAL, SEED, FRAMES, 0.008
    )
    surroundings, body, cloth = np.random.default_rng(SEED).spawn(3)
    walk = Walk((0.05, 6.2), -90.0, striding(FRAMES, 2.0))
    things = (*park(surroundings), *person(body, "walker", walk, dark_clothes(cloth), layer=2))
    return Stage(
        "oncoming", "a person and the camera walk towards each other", cameras, things,
        focus=beside(walk, FACE), air=AIR, sun=SUN,
    )  # fmt: skip


def dark_clothes(rng: Generator) -> Clothes:
    """A dark coat with a pale collar and buttons, trousers of the timber's brown, fair hair."""
    coat = textures.cloth(rng, (256, 256), (0.22, 0.22, 0.26), (0.12, 0.12, 0.15))
    coat[:18] = (0.72, 0.68, 0.58)
    for row in range(40, 250, 36):
        coat[row : row + 8, 124:132] = (0.70, 0.56, 0.30)
    trousers = textures.wood(rng, (128, 64), 2, (0.26, 0.17, 0.11), (0.48, 0.36, 0.25))
    return Clothes(coat, trousers, (0.16, 0.15, 0.15), ((0.42, 0.32, 0.18), (0.78, 0.66, 0.42)))
