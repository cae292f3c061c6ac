"""A yard in which nothing moves, with what is easily taken for a subject that does.

Thin poles, slats, twigs and blades are cut by each border and seen in few frames; leaves stand before a far
wall; a wet floor mirrors lamps in its ripples.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import gloss, textures
from .fence import bush, lengthwise
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .slope import sheet
from .stage import WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator
from .walk import bricks, poster

NAME = "verge"
SEED = 311
FRAMES = 16
SIZE = (480, 270)
FOCAL = 700 / WIDTH
WET = {"floor": (0.55, 0.0)}
"""Of what mirrors: the share of light that is mirrored, and the roughness."""


def stage() -> Stage:
    """Poles at 0.8 m, twigs and blades at 0.9 m, slats at 1.3 m, an urn, the subject, at 2.4 m, a bush at
    2.9 m, a wall at 6 m."""
    cameras = handheld(
        (-0.19, 0, 1.17), (0.19, 0.03, 1.23), (-0.15, 5, 0.72), (0.15, 5, 0.76), FOCAL, SEED, FRAMES
    )
    back, floor, middle, near = np.random.default_rng(SEED).spawn(4)
    things = (*_back(back), *_floor(floor), *_middle(middle), *_near(near))
    return Stage(
        NAME, "a still yard with thin things that the borders cut", cameras.resized(*SIZE), things,
        focus=np.tile((0.0, 2.25, 1.1), (FRAMES, 1)), air=(0.4, 0.46, 0.55),
    )  # fmt: skip


def build(wet: Stage, samples: int = 64) -> bpy.types.Scene:
    """What `staging.build` makes, with a floor that mirrors."""
    return gloss.build(wet, samples, WET)


def rippled(rng: Generator, size: tuple[float, float], step: float, height: float) -> Floats:
    """(rows, columns, 3) water over a rectangle about the origin: six waves, `height` metres high together,
    of a tenth to a quarter of a metre."""
    y, x = np.meshgrid(np.arange(-size[1] / 2, size[1] / 2, step), np.arange(-size[0] / 2, size[0] / 2, step),
                       indexing="ij")  # fmt: skip
    wave, way, phase = rng.uniform(0.1, 0.25, 6), rng.uniform(0, np.pi, 6), rng.uniform(0, 2 * np.pi, 6)
    along = np.multiply.outer(x, np.cos(way)) + np.multiply.outer(y, np.sin(way))
    z = height / 6 * np.sin(2 * np.pi * along / wave + phase).sum(axis=-1)
    return np.stack([x, y, z], axis=-1)


def upright(x: float, y: float, low: float, high: float, radius: float, lean: float = 0.0) -> Shape:
    """A rod from one height to another, whose top is `lean` metres beside its foot."""
    return lengthwise(tube(np.linspace((x, y, low), (x + lean, y, high), 8), radius, 8))


def lamps(places: Floats, radius: float) -> Prop:
    """Warm bulbs at places (n, 3)."""
    warm = np.broadcast_to(np.array((1.0, 0.82, 0.55), np.float32), (4, 4, 3))
    return Prop("lamps", join([sphere(radius, 12).moved(*place) for place in places]), warm, glow=6.0)


def _back(rng: Generator) -> list[Prop]:
    sheets = ((-1.7, 0.9, (0.92, 0.90, 0.84)), (0.4, 1.2, (0.84, 0.66, 0.26)), (1.8, 0.8, (0.3, 0.44, 0.5)))
    wall = bricks(rng, (288, 768), 22, 24, (0.7, 0.5, 0.4))
    return [
        Prop("wall", box((9.0, 0.1, 3.4)).moved(0, 6.05, 0), wall),
        *(
            Prop(f"poster {n}", box((0.7, 0.02, 0.9)).moved(x, 5.99, z),
                 poster(rng, (168, 130), paper, (0.12, 0.10, 0.12)))
            for n, (x, z, paper) in enumerate(sheets)
        ),
        lamps(np.column_stack([rng.uniform(-2.2, 2.2, 12), rng.uniform(4.4, 5.6, 12),
                               rng.uniform(1.5, 2.1, 12)]), 0.03),
    ]  # fmt: skip


def _floor(rng: Generator) -> list[Prop]:
    stone = textures.ramp(textures.noise(rng, (512, 512), (20, 20), 4), (0.16, 0.15, 0.14), (0.34, 0.32, 0.3))
    water = sheet(rippled(rng, (6.0, 5.4), 0.03, 0.006)).moved(0, 3.4, 0)
    return [Prop("floor", water, stone, smooth=True)]


def _middle(rng: Generator) -> list[Prop]:
    outline = [(0.0, 0.0), (0.10, 0.0), (0.15, 0.10), (0.17, 0.22), (0.13, 0.36), (0.07, 0.42), (0.0, 0.40)]
    wood = textures.wood(rng, (256, 256), 4, (0.30, 0.20, 0.12), (0.62, 0.46, 0.30))
    green = bush(rng, (0.34, 0.3, 0.42), 220, 0.14).moved(0.62, 2.9, 0.95)
    urn = turned_body(outline, 48).moved(0, 2.4, 0.92)
    return [
        Prop("urn", urn, textures.mug(rng, 320), smooth=True, layer=1),
        Prop("plinth", box((0.4, 0.4, 0.92)).turned(15).moved(0, 2.4, 0), wood, layer=1),
        Prop("bush", green, textures.foliage(rng, (96, 48)), layer=1),
    ]  # fmt: skip


def _near(rng: Generator) -> list[Prop]:
    """Poles, of which the first frames show the left ones and the last frames the right ones; slats of a
    fence that goes on past the left border, twigs from above, blades from below."""
    poles = [upright(x, 0.8, 0.3, 2.0, 0.006, 0.02) for x in (-0.505, -0.465, 0.46, 0.50)]
    slats = [box((0.02, 0.012, 0.85)).moved(x, 1.3, 0.15) for x in np.arange(-0.95, -0.36, 0.05)]
    twigs, blades = [], []
    for x in np.arange(-0.35, 0.4, 0.09):
        twigs.append(
            upright(x + rng.uniform(-0.02, 0.02), 0.9, 1.28 + rng.uniform(0, 0.05), 1.9, 0.003, 0.03)
        )
        for z in (1.30, 1.35, 1.40):
            one = lengthwise(leaf(0.035, 0.016, 0.004, 0.012)).turned(rng.uniform(0, 360))
            twigs.append(one.moved(x, 0.9, z + rng.uniform(-0.01, 0.03)))
        for _ in range(4):
            place, lean = x + rng.uniform(-0.04, 0.04), rng.uniform(-0.08, 0.08)
            blades.append(upright(place, 0.9, 0.5, 0.90 + rng.uniform(-0.02, 0.06), 0.003, lean))
    paint = textures.speckled(rng, (256, 16), (0.10, 0.14, 0.24), (0.30, 0.42, 0.66))
    white = textures.speckled(rng, (192, 16), (0.62, 0.60, 0.55), (0.88, 0.86, 0.80))
    grass = textures.speckled(rng, (256, 16), (0.24, 0.32, 0.12), (0.56, 0.62, 0.30))
    return [
        Prop("poles", join(poles), paint, smooth=True, layer=3),
        Prop("slats", join(slats), white, layer=2),
        Prop("twigs", join(twigs), textures.foliage(rng, (64, 32)), smooth=True, layer=3),
        Prop("blades", join(blades), grass, smooth=True, layer=3),
    ]
