"""A park for people to walk in: a path between lawn and hedge, a bench, posts, a flower bed; cabins behind.

Shared by the scenes whose subject moves. The hedge stands at 7 m, the path from 2.6 to 5.8 m.
"""

from __future__ import annotations

import numpy as np

from . import textures
from .fence import GREENS, STONES, bush, cobbles, far, hedge, lengthwise
from .shapes import box, join, tube
from .stage import Prop
from .textures import Generator

AIR = (0.52, 0.62, 0.76)
SUN = (-0.4, -0.65, 0.7)


def park(rng: Generator) -> list[Prop]:
    """Everything that stands still, in the layers 0 and 1."""
    behind, green, ground, near = rng.spawn(4)
    return [*far(behind), *hedge(green), *_ground(ground), *_furniture(near)]


def _ground(rng: Generator) -> list[Prop]:
    """The path of gravel, its kerbs, and grass on both of its sides, fine enough to be seen near."""
    gravel = cobbles(rng, (320, 1400), 5, *STONES)
    grass = cobbles(rng, (200, 1400), 4, *GREENS)
    kerb = cobbles(rng, (24, 1200), 22, *STONES)
    kerbs = [box((14, 0.10, 0.05)).moved(0, y, 0) for y in (2.55, 5.85)]
    lawns = [box((14, wide, 0.006)).moved(0, y, 0) for y, wide in ((1.6, 1.9), (6.45, 1.2))]
    return [
        Prop("path", box((14, 3.3, 0.008)).moved(0, 4.2, 0), gravel),
        Prop("kerbs", join(kerbs), kerb),
        Prop("grass", join(lawns), grass),
    ]


def _furniture(rng: Generator) -> list[Prop]:
    """A bench and posts before the hedge, low flowers at the path's farther edge."""
    timber = textures.wood(rng, (96, 512), 3, (0.24, 0.15, 0.09), (0.60, 0.44, 0.28))
    boards = [box((1.7, 0.035, 0.09)).moved(0, 0.12, z) for z in (0.60, 0.74)]
    seats = [box((1.7, 0.10, 0.03)).moved(0, y, 0.42) for y in (-0.26, -0.13, 0.0)]
    legs = [box((0.06, 0.42, 0.44)).moved(x, -0.08, 0) for x in (-0.75, 0.75)]
    backs = [box((0.05, 0.03, 0.86)).moved(x, 0.15, 0) for x in (-0.75, 0.75)]
    posts = [
        lengthwise(tube(np.linspace((x, 6.0, 0.0), (x, 6.0, 1.0), 6), 0.05, 14)) for x in (-2.9, -1.1, 2.4)
    ]
    flowers = [
        bush(rng, (0.14, 0.08, 0.10), 22, 0.08).moved(x, 6.0, 0.06) for x in np.arange(-2.6, 3.0, 0.62)
    ]
    paint = textures.speckled(rng, (256, 64), (0.30, 0.32, 0.34), (0.72, 0.70, 0.62))
    return [
        Prop("bench", join([*boards, *seats, *legs, *backs]).moved(0.75, 6.35, 0), timber, layer=1),
        Prop("posts", join(posts), paint, smooth=True, layer=1),
        Prop("flowers", join(flowers), textures.foliage(rng, (64, 32))),
    ]
