"""Two people who pass each other: the nearer one hides the farther one for a while."""

from __future__ import annotations

import numpy as np

from .figure import Walk, person, striding
from .park import AIR, SUN, park
from .pause import red_clothes
from .stage import Stage, handheld
from .stroller import beside, green_clothes

SEED = 149
FOCAL = 1.0
FRAMES = 60


def stage() -> Stage:
    """One at 3.9 m walks to the right, one at 4.9 m to the left; they pass in the middle. The nearer is in
    focus."""
    cameras = handheld(
        (-0.35, 0, 1.38), (0.35, 0.05, 1.36), (-0.15, 4.4, 0.98), (0.25, 4.4, 0.98), FOCAL, SEED, FRAMES
    )
    surroundings, bodies, cloths = np.random.default_rng(SEED).spawn(3)
    near_body, far_body = bodies.spawn(2)
    near_cloth, far_cloth = cloths.spawn(2)
    near = Walk((-1.25, 3.9), 0.0, striding(FRAMES, 2.7, 0.2))
    far = Walk((1.55, 4.9), 180.0, striding(FRAMES, 2.9, 0.4))
    things = (
        *park(surroundings),
        *person(far_body, "far", far, red_clothes(far_cloth), layer=2),
        *person(near_body, "near", near, green_clothes(near_cloth), layer=3),
    )
    return Stage(
        "crossing", "two people who pass each other", cameras, things, focus=beside(near), air=AIR, sun=SUN
    )
