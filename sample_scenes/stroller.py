"""A person who walks past a hedge, dressed in colours of hedge and path; arms and legs swing."""

from __future__ import annotations

import numpy as np

from . import textures
from .figure import Clothes, Walk, person, striding
from .park import AIR, SUN, park
from .stage import Floats, Stage, handheld
from .textures import Generator

SEED = 131
FOCAL = 1.0
FRAMES = 60
HEAD = np.array([0.04, -0.08, 1.64])
"""The point in focus, from the ground under the hips of one who walks to the right."""


def stage() -> Stage:
    """A person at 4.2 m walks to the right; the camera goes with them more slowly and turns after them."""
    cameras = handheld(
        (-0.40, 0, 1.35), (0.40, 0.04, 1.37), (-0.75, 4.2, 0.98), (0.75, 4.2, 0.98), FOCAL, SEED, FRAMES
    )
    surroundings, body, cloth = np.random.default_rng(SEED).spawn(3)
    walk = Walk((-1.55, 4.2), 0.0, striding(FRAMES, 3.1, 0.1))
    things = (*park(surroundings), *person(body, "stroller", walk, green_clothes(cloth), layer=2))
    return Stage(
        "stroller", "a person who walks past a hedge", cameras, things,
        focus=beside(walk), air=AIR, sun=SUN,
    )  # fmt: skip


def green_clothes(rng: Generator) -> Clothes:
    """A jacket of the hedge's greens with checks, trousers of the path's greys, hair brown as the timber."""
    jacket = textures.cloth(rng, (256, 256), (0.34, 0.42, 0.24), (0.20, 0.28, 0.15))
    jacket[:, 112:144] *= 0.75
    jacket[118:132] = textures.mix(jacket[118:132], (0.62, 0.56, 0.40), 0.7)
    trousers = textures.speckled(rng, (128, 64), (0.30, 0.29, 0.28), (0.56, 0.53, 0.48))
    return Clothes(jacket, trousers, (0.36, 0.24, 0.15), ((0.16, 0.10, 0.06), (0.50, 0.36, 0.22)))


def beside(walk: Walk, offset: Floats = HEAD) -> Floats:
    """(N, 3) the point at an offset, in the body's axes but for y, which is the world's, from a walk."""
    angle = np.radians(walk.heading)
    ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
    ground = np.array([*walk.start, 0.0]) + walk.way[:, None] * ahead
    return np.asarray(ground + offset[0] * ahead + offset * (0, 1, 1))
