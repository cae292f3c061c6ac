"""A yard seen from a porch, the camera sliding past: a post and a branch are just outside the picture.

In the middle of the clip the post ends a few pixels past the left border and the branch begins a few past the
right one; frames before show the one whole, frames after the other. Their blur must come in all the same.
"""

from __future__ import annotations

import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, tube, turned_body
from .stage import WIDTH, Prop, Stage, handheld
from .textures import Generator
from .walk import bricks, poster

SEED = 83
FOCAL = 680 / WIDTH
WALL = 5.0
SUBJECT = (0.02, 2.4)
"""x and y of the urn."""
SILL = 0.93
"""Height of the railing's top, which the urn's table shares."""
POST = (-0.4687, 0.9)
"""x and y of the post, so that its right edge is 4 pixels past the left border in frame 12."""
BRANCH = (0.443, 0.9)
"""x and y of the branch's nearest leaves, 20 pixels past the right border in frame 12, 5 in frame 14."""


def stage() -> Stage:
    """Post and branch at 0.9 m, a railing at 1.3 m, the subject, an urn, at 2.4 m, a wall at 5 m."""
    cameras = handheld(
        (-0.12, 0, 1.2), (0.12, 0.01, 1.2), (-0.12, WALL, 1.12), (0.12, WALL, 1.12), FOCAL, SEED, 24, 0.001
    )
    back, subject, near = np.random.default_rng(SEED).spawn(3)
    things = (*_back(back), *_subject(subject), *_near(near))
    return Stage(
        "porch", "a near post and a branch just outside the picture", cameras, things,
        focus=np.tile((SUBJECT[0], SUBJECT[1] - 0.15, SILL + 0.16), (len(cameras), 1)), air=(0.2, 0.22, 0.25),
    )  # fmt: skip


def _back(rng: Generator) -> list[Prop]:
    """A brick wall with posters, tubs before it, the ground."""
    wall = bricks(rng, (288, 704), 20, 22, (0.70, 0.44, 0.34))
    ground = textures.speckled(rng, (512, 512), (0.20, 0.18, 0.14), (0.58, 0.54, 0.44))
    sheets = (
        (-1.5, 0.9, (0.92, 0.90, 0.84)),
        (0.55, 1.0, (0.84, 0.66, 0.26)),
        (1.75, 0.8, (0.30, 0.44, 0.50)),
    )
    tub = [(0.0, 0.0), (0.22, 0.0), (0.28, 0.5), (0.30, 0.5), (0.30, 0.56), (0.0, 0.5)]
    tubs = [turned_body(tub, 32).moved(x, WALL - 0.7, 0.35) for x in (-0.75, 1.25)]
    return [
        Prop("wall", box((8.0, 0.1, 3.2)).moved(0, WALL + 0.05, 0), wall),
        Prop("ground", box((8.0, 6.0, 0.1)).moved(0, 2.5, -0.1), ground),
        *(
            Prop(f"poster {n}", box((0.6, 0.02, 0.78)).moved(x, WALL - 0.01, z),
                 poster(rng, (168, 130), paper, (0.12, 0.10, 0.12)))
            for n, (x, z, paper) in enumerate(sheets)
        ),
        Prop("tubs", join(tubs), textures.cloth(rng, (128, 256), (0.30, 0.46, 0.40), (0.62, 0.60, 0.46)),
             smooth=True, layer=1),
    ]  # fmt: skip


def _subject(rng: Generator) -> list[Prop]:
    """An urn on a table."""
    outline = [(0.0, 0.0), (0.08, 0.0), (0.13, 0.10), (0.15, 0.20), (0.11, 0.32), (0.07, 0.38), (0.09, 0.43)]
    outline += [(0.07, 0.43), (0.0, 0.36)]
    urn = turned_body(outline, 64).moved(*SUBJECT, SILL)
    table = textures.wood(rng, (192, 256), 3, (0.34, 0.22, 0.13), (0.70, 0.52, 0.34))
    return [
        Prop("table", box((0.9, 0.6, 0.06)).moved(*SUBJECT, SILL - 0.06), table, layer=2),
        Prop("urn", urn, textures.mug(rng, 320), smooth=True, layer=2),
    ]  # fmt: skip


def _near(rng: Generator) -> list[Prop]:
    """The railing across the picture, and what stands outside of it."""
    plank = textures.wood(rng, (96, 768), 2, (0.36, 0.30, 0.22), (0.76, 0.68, 0.52))
    paint = textures.speckled(rng, (512, 48), (0.06, 0.10, 0.24), (0.26, 0.38, 0.72))
    paint[::48] = (0.92, 0.88, 0.70)
    x, y = BRANCH
    height = np.linspace(1.9, 1.02, 12)[:, None]
    twig = tube(np.hstack([x + 0.05 + 0.02 * np.sin(9 * height), np.full_like(height, y), height]), 0.004, 8)
    leaves = []
    for z in np.linspace(1.42, 1.02, 26):
        foliage = leaf(rng.uniform(0.03, 0.05), rng.uniform(0.014, 0.022), 0.01, rng.uniform(0.02, 0.03))
        turned = foliage.turned(rng.uniform(30, 70), "x").turned(rng.uniform(-50, 50) + 180 * rng.integers(2))
        leaves.append(turned.moved(x + 0.055, y + rng.uniform(0, 0.03), z))
    leaves = [Shape(each.vertices, each.faces, each.uv[..., ::-1]) for each in (*leaves, twig)]
    return [
        Prop("railing", box((2.4, 0.08, 0.06)).moved(0, 1.3, SILL - 0.06), plank, layer=3),
        Prop("post", box((0.04, 0.04, 2.0)).moved(POST[0], POST[1] + 0.02, 0.3), paint, layer=4),
        Prop("branch", join(leaves), textures.foliage(rng, (192, 72)), smooth=True, layer=4),
    ]
