"""Real lamps far behind a sharp subject: bulbs of 40, 150 and 800 times white, a pixel or two in radius.

The scene `bars` without what is close, and with bulbs in place of its paper lanterns, whose 6 times white
is what a lamp behind paper or glass has: a bare one has 30 to over 1,000 in a picture that is exposed for
what it stands in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import bars
from .shapes import join, sphere
from .stage import WIDTH, Prop, Stage, handheld

SEED = 37
FRAMES = 24
KINDS = (
    (9, 0.019, 40.0, (1.0, 0.80, 0.52)),
    (8, 0.016, 150.0, (1.0, 0.90, 0.72)),
    (5, 0.02, 800.0, (1.0, 1.0, 1.0)),
)
"""How many of a kind, radius in metres, times white, and tint."""
LEFT_OUT = ("lamps", "bars", "leaves")
DAYLIGHT = 0.7
"""Radiance of white paint. All things glow: what bulbs throw on paint would be noise of few bright pixels."""


def stage() -> Stage:
    """A vase at 3 m, a street with bulbs from 7 m to 14 m."""
    cameras = handheld(
        (-0.07, 0, 1.25), (0.07, 0.02, 1.24), (-0.02, 3, 1.2), (0.03, 3, 1.19), 700 / WIDTH, SEED, FRAMES
    )
    things = [replace(thing, glow=DAYLIGHT) for thing in bars.stage().things if thing.name not in LEFT_OUT]
    return Stage(
        "bulbs", "bare bulbs, far over white, behind a sharp subject", cameras, (*things, *_bulbs()),
        focus=np.tile(bars.SUBJECT, (len(cameras), 1)) - [0, 0.16, 0], air=(0.012, 0.016, 0.03),
    )  # fmt: skip


def _bulbs() -> list[Prop]:
    """On a grid that is shaken, so that few discs lie on each other; behind the vase there are none."""
    rng = np.random.default_rng(SEED)
    x, z = np.meshgrid(np.linspace(-0.41, 0.41, 8), np.linspace(-0.06, 0.22, 3))
    slope = np.column_stack([x.ravel(), z.ravel()]) + rng.uniform(-0.025, 0.025, (x.size, 2))
    slope = rng.permutation(slope[np.abs(slope[:, 0]) > 0.08])
    depth = rng.uniform(7.0, 10.0, len(slope))
    place = np.column_stack([slope[:, 0] * depth, depth, 1.25 + slope[:, 1] * depth])
    props, first = [], 0
    for count, radius, glow, tint in KINDS:
        some = place[first : first + count]
        paint = np.broadcast_to(np.array(tint, np.float32), (4, 4, 3))
        props.append(Prop(
            f"bulbs of {glow:g}", join([sphere(radius, 12).moved(*each) for each in some]), paint,
            smooth=True, glow=glow, layer=1,
        ))  # fmt: skip
        first += count
    return props
