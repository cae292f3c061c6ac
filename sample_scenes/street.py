"""A street at night behind a sharp subject: bulbs, headlights and street lamps far over white, windows and
paper lanterns a little over it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import bars, textures
from .shapes import Shape, box, join, sphere
from .stage import WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 61
FRAMES = 24
DARK, LIT = 0.1, 0.6
"""Radiance of white paint in the street and at the subject. All things glow: what lamps throw on paint would
be noise of few bright pixels."""
WARM, WHITE, SODIUM, RED, GREEN = (
    (1.0, 0.8, 0.5),
    (0.95, 0.98, 1.0),
    (1.0, 0.62, 0.22),
    (1.0, 0.12, 0.06),
    (0.15, 1.0, 0.6),
)


def stage() -> Stage:
    """A vase at 3 m in the light of a window, a street from 7 m to 30 m."""
    cameras = handheld(
        (-0.09, 0, 1.25), (0.09, 0.02, 1.24), (-0.02, 3, 1.2), (0.03, 3, 1.19), 700 / WIDTH, SEED, FRAMES
    )
    subject = [replace(thing, glow=LIT) for thing in bars.stage().things if thing.name in ("vase", "plinth")]
    rng = np.random.default_rng(SEED)
    return Stage(
        "street", "a street at night: lamps of all kinds behind a sharp subject", cameras,
        (*_houses(rng), *_lights(rng), *subject),
        focus=np.tile(bars.SUBJECT, (len(cameras), 1)) - [0, 0.16, 0], air=(0.004, 0.005, 0.010),
    )  # fmt: skip


def _houses(rng: Generator) -> list[Prop]:
    """The road, and houses on both sides and at the end, some of whose windows are lit."""
    road = textures.speckled(rng, (768, 768), (0.10, 0.10, 0.13), (0.42, 0.40, 0.42))
    props = [Prop("road", box((24, 40, 0.02)).moved(0, 18, -0.02), road, glow=DARK)]
    for number, (x, y, wide, high) in enumerate((
        (-5.2, 11.0, 4.0, 5.0), (-6.4, 18.0, 5.0, 7.0), (5.6, 12.0, 4.4, 6.0), (6.6, 19.0, 5.0, 6.5),
        (-2.6, 29.0, 6.0, 8.0), (3.4, 30.0, 6.4, 9.0),
    )):  # fmt: skip
        plaster = textures.speckled(rng, (320, 256), rng.uniform(0.1, 0.25, 3), rng.uniform(0.35, 0.55, 3))
        props.append(Prop(f"house {number}", box((wide, 2.0, high)).moved(x, y, 0), plaster, glow=DARK))
        panes = [
            box((0.5, 0.02, 0.7)).moved(x + across * wide, y - 1.02, 1.0 + 1.3 * floor)
            for floor in range(int(high / 1.3) - 1)
            for across in (-0.33, -0.11, 0.11, 0.33)
            if rng.random() < 0.35
        ]
        if panes:
            props.append(
                Prop(f"windows {number}", join(panes), _curtain(rng), glow=float(rng.uniform(0.5, 3.0)))
            )
    return props


def _curtain(rng: Generator) -> Picture:
    return textures.cloth(rng, (48, 32), (0.75, 0.55, 0.28), (1.0, 0.82, 0.5))


def _lights(rng: Generator) -> list[Prop]:
    """Each kind of lamp."""
    x = np.linspace(-2.8, 2.8, 15)
    garland = np.column_stack([x, np.full(15, 8.5), 2.55 - 0.28 * np.abs(np.sin(np.pi * np.arange(15) / 5))])
    lanterns = np.column_stack([np.linspace(-2.9, 2.7, 6), np.full(6, 9.6), rng.uniform(3.3, 3.6, 6)])
    side = np.repeat([-2.7, 2.9], 4)
    posts = np.column_stack([side, np.tile([10.0, 14.0, 19.0, 25.0], 2), np.full(8, 3.4)])
    cars = np.array([(-0.9, 15.0), (0.3, 21.0), (-1.1, 27.0)])
    heads = np.array([(cx + dx, cy, 0.65) for cx, cy in cars for dx in (-0.35, 0.35)])
    tails = np.array([(cx + dx, cy, 0.75) for cx, cy in ((1.3, 12.0), (1.6, 18.0)) for dx in (-0.35, 0.35)])
    signal = np.array([(-1.9, 13.0, 2.5), (2.2, 17.0, 2.5)])
    iron = textures.speckled(rng, (64, 16), (0.02, 0.02, 0.02), (0.08, 0.08, 0.08))
    return [
        Prop(
            "posts",
            join([box((0.06, 0.06, z - 0.06)).moved(px, y, 0) for px, y, z in posts]),
            iron,
            glow=DARK,
            layer=1,
        ),
        _glowing("garland", garland, 0.016, WARM, 60.0),
        _glowing("lanterns", lanterns, 0.11, (1.0, 0.55, 0.3), 4.0),
        _glowing("street lamps", posts, 0.05, SODIUM, 300.0),
        _glowing("headlights", heads, 0.06, WHITE, 800.0),
        _glowing("tail lights", tails, 0.05, RED, 20.0),
        _glowing("signals", signal, 0.06, GREEN, 30.0),
    ]


def _glowing(name: str, places: Floats, radius: float, tint: tuple[float, float, float], glow: float) -> Prop:
    """Balls at places (n, 3)."""
    balls: list[Shape] = [sphere(radius, 12).moved(*each) for each in places]
    paint = np.broadcast_to(np.array(tint, np.float32), (4, 4, 3))
    return Prop(name, join(balls), paint, smooth=True, glow=glow, layer=1)
