"""A café's corner with surfaces that fool stereo, each at a place of its own.

A split chair rail, leaves and a post are cut by the border of the picture; bars and a blind repeat
themselves; a painted board and a screen, lacquered, show two bright windows behind the camera.
"""

from __future__ import annotations

import bpy
import numpy as np

from . import gloss, textures
from .shapes import Shape, box, join, leaf, tube, turned_body
from .stage import WIDTH, Prop, Stage, handheld
from .textures import Generator
from .walk import bricks, poster

NAME = "surfaces"
SEED = 227
FRAMES = 24
FOCAL = 680 / WIDTH
WALL = 5.0
TABLE = 0.95
LACQUER = {"board": (0.08, 0.05), "screen": (0.12, 0.15)}
"""Of what is lacquered: the share of light that is mirrored, and the roughness."""
PLACES = {
    "border": ("rail", "leaves", "post"),
    "bars": ("bars",),
    "blind": ("blind",),
    "board": ("board",),
    "screen": ("screen",),
}
"""Things by what is hard about them."""


def stage() -> Stage:
    """Rail, leaves and post at 0.8 to 0.9 m, bars and blind at 1.7 m, an urn, the subject, at 2.4 m, boards
    at 3.4 m, a wall at 5 m."""
    cameras = handheld(
        (-0.12, 0, 1.18), (0.12, 0.01, 1.22), (-0.12, WALL, 1.18), (0.12, WALL, 1.22), FOCAL, SEED, FRAMES,
        0.001,
    )  # fmt: skip
    back, subject, slats, near = np.random.default_rng(SEED).spawn(4)
    things = (*_back(back), *_subject(subject), *_slats(slats), *_near(near))
    return Stage(
        NAME, "surfaces that fool stereo", cameras, things,
        focus=np.tile((0.0, 2.25, TABLE + 0.16), (FRAMES, 1)), air=(0.2, 0.22, 0.25),
    )  # fmt: skip


def build(lacquered: Stage, samples: int = 64) -> bpy.types.Scene:
    """What `staging.build` makes, with the boards of `LACQUER` mirroring the windows."""
    scene = gloss.build(lacquered, samples, LACQUER)
    windows = next(each for each in scene.objects if each.name.startswith("windows"))
    # They are seen in lacquer, and light nothing.
    windows.visible_diffuse = False
    windows.data.materials[0].cycles.emission_sampling = "AUTO"
    return scene


def _back(rng: Generator) -> list[Prop]:
    """A brick wall with posters, the ground; before it two boards, and windows behind the camera."""
    wall = bricks(rng, (288, 704), 20, 22, (0.70, 0.44, 0.34))
    ground = textures.speckled(rng, (512, 512), (0.20, 0.18, 0.14), (0.58, 0.54, 0.44))
    sheets = (
        (-1.5, 0.9, (0.92, 0.90, 0.84)),
        (0.3, 0.95, (0.84, 0.66, 0.26)),
        (1.6, 0.8, (0.30, 0.44, 0.50)),
    )
    windows = [box((0.45, 0.02, 0.45)).moved(x, -2.0, 2.02) for x in (-1.3, -0.7, 0.35, 1.0)]
    return [
        Prop("wall", box((8.0, 0.1, 3.2)).moved(0, WALL + 0.05, 0), wall),
        Prop("ground", box((8.0, 8.0, 0.1)).moved(0, 2.0, -0.1), ground),
        *(
            Prop(f"poster {n}", box((0.6, 0.02, 0.78)).moved(x, WALL - 0.01, z),
                 poster(rng, (168, 130), paper, (0.12, 0.10, 0.12)))
            for n, (x, z, paper) in enumerate(sheets)
        ),
        Prop("board", box((0.8, 0.03, 0.5)).moved(-0.42, 3.4, 1.35), textures.landscape(rng, (240, 384)),
             layer=1),
        Prop("screen", box((0.7, 0.03, 0.5)).moved(0.42, 3.4, 1.35),
             textures.speckled(rng, (240, 336), (0.03, 0.04, 0.06), (0.14, 0.16, 0.22)), layer=1),
        Prop("windows", join(windows), np.ones((8, 8, 3), np.float32), glow=6.0),
    ]  # fmt: skip


def _subject(rng: Generator) -> list[Prop]:
    """An urn on a table."""
    outline = [(0.0, 0.0), (0.08, 0.0), (0.13, 0.10), (0.15, 0.20), (0.11, 0.32), (0.07, 0.38), (0.0, 0.36)]
    urn = turned_body(outline, 64).moved(0, 2.4, TABLE)
    table = textures.wood(rng, (192, 256), 3, (0.34, 0.22, 0.13), (0.70, 0.52, 0.34))
    return [
        Prop("table", box((0.9, 0.6, 0.06)).moved(0, 2.4, TABLE - 0.06), table, layer=2),
        Prop("urn", urn, textures.mug(rng, 320), smooth=True, layer=2),
    ]


def _slats(rng: Generator) -> list[Prop]:
    """Bars of 9 pixels in steps of 19 at the right, a blind of 8 in steps of 17 at the left."""
    bars = [box((0.022, 0.015, 0.62)).moved(x, 1.7, 1.0) for x in np.arange(0.26, 0.62, 0.048)]
    blind = [box((0.44, 0.012, 0.02)).moved(-0.46, 1.7, z) for z in np.arange(1.06, 1.46, 0.042)]
    steel = textures.speckled(rng, (256, 32), (0.16, 0.18, 0.20), (0.30, 0.32, 0.34))
    white = textures.speckled(rng, (32, 256), (0.74, 0.73, 0.70), (0.82, 0.81, 0.78))
    return [Prop("bars", join(bars), steel, layer=3), Prop("blind", join(blind), white, layer=3)]


def _near(rng: Generator) -> list[Prop]:
    """What the border cuts: two rails of a chair with a gap between them, leaves, a post."""
    stained = textures.wood(rng, (64, 512), 2, (0.30, 0.17, 0.09), (0.66, 0.46, 0.28))
    rails = [box((0.34, 0.02, high)).moved(0.02, 0.8, z) for high, z in ((0.022, 1.026), (0.030, 0.985))]
    uprights = [box((0.02, 0.02, 0.12)).moved(x, 0.8, 0.92) for x in (-0.14, 0.02, 0.18)]
    leaves = []
    for z in np.linspace(1.36, 0.98, 22):
        foliage = leaf(rng.uniform(0.04, 0.07), rng.uniform(0.014, 0.022), 0.01, rng.uniform(0.02, 0.03))
        turned = foliage.turned(rng.uniform(30, 70), "x").turned(rng.uniform(-50, 50) + 180 * rng.integers(2))
        leaves.append(turned.moved(-0.41, 0.9 + rng.uniform(0, 0.03), z))
    height = np.linspace(1.9, 0.9, 12)[:, None]
    stem = tube(np.hstack([-0.41 + 0.01 * np.sin(9 * height), np.full_like(height, 0.9), height]), 0.004, 8)
    paint = textures.speckled(rng, (512, 48), (0.06, 0.10, 0.24), (0.26, 0.38, 0.72))
    paint[::48] = (0.92, 0.88, 0.70)
    leaves = [Shape(each.vertices, each.faces, each.uv[..., ::-1]) for each in (*leaves, stem)]
    return [
        Prop("rail", join(rails + uprights), stained, layer=4),
        Prop("leaves", join(leaves), textures.foliage(rng, (192, 72)), smooth=True, layer=4),
        Prop("post", box((0.04, 0.04, 2.0)).moved(0.425, 0.92, 0.3), paint, layer=4),
    ]
