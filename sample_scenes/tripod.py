"""Someone walks past a camera on a tripod that stands still: no parallax, but all that they hide is seen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .figure import Clothes, Walk, person, striding
from .park import AIR, SUN, park
from .pause import red_clothes
from .stage import HEIGHT, WIDTH, Cameras, Prop, Stage, look
from .textures import Generator

SEED = 149
FRAMES = 36
FOCAL = 1.0
CENTRE = (0.0, 0.0, 1.36)
ACROSS = 4.0
"""Distance in metres at which someone walks."""
BENCH = (0.75, 6.452, 0.645)
"""The point in focus: on the bench's boards, which nobody hides in the frames that are judged."""


def stage() -> Stage:
    """A person at 4 m walks to the right; in focus is the bench behind them."""
    things = tuple(filmed(SEED, walk(2.6), red_clothes))
    return Stage(
        "tripod", "a camera that stands still, and a person walks past", turning(0.0), things,
        focus=np.tile(BENCH, (FRAMES, 1)), air=AIR, sun=SUN,
    )  # fmt: skip


def walk(metres: float) -> Walk:
    """To the right, the middle of it before the camera."""
    return Walk((-metres / 2, ACROSS), 0.0, striding(FRAMES, metres, 0.0))


def filmed(seed: int, path: Walk, clothes: Callable[[Generator], Clothes]) -> list[Prop]:
    """The park, and who walks."""
    surroundings, body, cloth = np.random.default_rng(seed).spawn(3)
    return [*park(surroundings), *person(body, "walker", path, clothes(cloth), layer=2)]


def turning(degrees: float) -> Cameras:
    """A camera on a tripod that turns to the right by so many degrees, evenly."""
    angle = np.radians(degrees) * np.linspace(-0.5, 0.5, FRAMES)
    gaze = np.stack([np.sin(angle), np.cos(angle), np.full(FRAMES, -0.09)], axis=1)
    rotation, translation = look(np.tile(CENTRE, (FRAMES, 1)), gaze, np.zeros((FRAMES, 3)))
    return Cameras(WIDTH, HEIGHT, FOCAL * WIDTH, rotation, translation)
