"""A pond at dusk in which nothing moves, filmed by a camera that is carried forward and up.

Its ripples mirror lanterns and a lit shore: highlights that wander as the camera does. Reeds, the posts of a
jetty and hanging branches leave the picture by every border. The same kind as `verge`, with nothing in common
but that.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import gloss, textures
from .fence import GREENS, STONES, bush, cobbles, lengthwise
from .shapes import box, join, leaf, turned_body
from .slope import sheet
from .stage import WIDTH, Prop, Stage, handheld
from .textures import Generator
from .verge import lamps, rippled, upright

NAME = "pond"
SEED = 523
FRAMES = 16
SIZE = (480, 270)
FOCAL = 620 / WIDTH
WET = {"water": (0.8, 0.0)}
"""Of what mirrors: the share of light that is mirrored, and the roughness."""


def stage() -> Stage:
    """Reeds at 0.9 to 1.3 m, a jetty from 1 to 4 m at the right, a buoy, the subject, at 3 m, a tree at 5 m,
    the shore at 8 m."""
    cameras = handheld(
        (0.05, -0.25, 0.95), (-0.06, 0.05, 1.14), (0.0, 6, 0.35), (-0.05, 6, 0.42), FOCAL, SEED, FRAMES
    )
    shore, water, middle, near = np.random.default_rng(SEED).spawn(4)
    things = (*_shore(shore), *_water(water), *_middle(middle), *_near(near))
    return Stage(
        NAME, "a still pond that glitters", cameras.resized(*SIZE), things,
        focus=np.tile((-0.15, 2.85, 0.25), (FRAMES, 1)), air=(0.10, 0.12, 0.22), sun=(0.5, -0.6, 0.4),
    )  # fmt: skip


def build(wet: Stage, samples: int = 64) -> bpy.types.Scene:
    """What `staging.build` makes, with water that mirrors."""
    return gloss.build(wet, samples, WET)


def _shore(rng: Generator) -> list[Prop]:
    stones = cobbles(rng, (96, 900), 12, *STONES)
    hedge = cobbles(rng, (160, 900), 6, *GREENS)
    places = np.column_stack([rng.uniform(-3, 3, 14), rng.uniform(6.0, 7.6, 14), rng.uniform(0.7, 2.0, 14)])
    return [
        Prop("quay", box((14, 0.4, 0.5)).moved(0, 8.2, -0.1), stones),
        Prop("hedge", box((14, 0.4, 1.1)).moved(0, 8.7, 0.3), hedge),
        Prop("house", box((3.4, 0.5, 2.6)).moved(-1.8, 9.6, 0.3), textures.book_spines(rng, 14)),
        lamps(places, 0.045),
    ]


def _water(rng: Generator) -> list[Prop]:
    deep = textures.speckled(rng, (256, 256), (0.03, 0.06, 0.06), (0.10, 0.15, 0.12))
    return [Prop("water", sheet(rippled(rng, (12.0, 9.0), 0.04, 0.02)).moved(0, 3.6, 0), deep, smooth=True)]


def _middle(rng: Generator) -> list[Prop]:
    buoy = turned_body([(0.0, -0.05), (0.2, -0.02), (0.22, 0.1), (0.1, 0.3), (0.05, 0.5), (0.0, 0.5)], 40)
    wood = textures.wood(rng, (256, 64), 2, (0.26, 0.18, 0.11), (0.60, 0.46, 0.32))
    posts = [upright(0.75 + 0.02 * n, 1.2 + 0.28 * n, -0.2, 0.72, 0.022) for n in range(11)]
    rails = [box((0.03, 4.2, 0.03)).turned(-4).moved(0.84, 2.9, z) for z in (0.45, 0.66)]
    crown = bush(rng, (0.8, 0.5, 0.6), 420, 0.2).moved(-1.55, 5.0, 1.35)
    return [
        Prop("buoy", buoy.moved(-0.15, 3.0, 0), textures.mug(rng, 200), smooth=True, layer=1),
        Prop("posts", join(posts), wood, smooth=True, layer=2),
        Prop("rails", join(rails), np.ascontiguousarray(wood.swapaxes(0, 1)), layer=2),
        Prop("tree", crown, textures.foliage(rng, (96, 48)), layer=1),
        Prop("trunk", upright(-1.6, 5.0, -0.1, 1.2, 0.06, 0.05), wood[:, ::-1], smooth=True, layer=1),
    ]


def _near(rng: Generator) -> list[Prop]:
    """Reeds before the camera, of which it passes some, and branches that hang into the picture."""
    reeds = [
        upright(x, y, -0.1, rng.uniform(0.62, 0.98), 0.005, rng.uniform(-0.08, 0.08))
        for x, y in zip(rng.uniform(-0.75, 0.5, 26), rng.uniform(0.6, 1.35, 26), strict=True)
    ]
    branches = []
    for x in (-0.55, -0.38, 0.12, 0.2, 0.41):
        y, low = rng.uniform(0.9, 1.2), rng.uniform(1.05, 1.2)
        branches.append(upright(x, y, low, 2.0, 0.004, rng.uniform(-0.1, 0.1)))
        for z in np.arange(low, 1.5, 0.035):
            one = lengthwise(leaf(0.05, 0.018, 0.006, 0.02)).turned(rng.uniform(0, 360))
            branches.append(one.moved(x, y, z))
    straw = textures.speckled(rng, (256, 16), (0.40, 0.34, 0.16), (0.78, 0.70, 0.40))
    return [
        Prop("reeds", join(reeds), straw, smooth=True, layer=3),
        Prop("branches", join(branches), textures.foliage(rng, (64, 32)), smooth=True, layer=3),
    ]
