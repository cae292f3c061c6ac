"""Thin bars and leaves close to the camera, a sharp subject behind them, small lights far away."""

from __future__ import annotations

import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .stage import WIDTH, Prop, Stage, handheld

SEED = 31
SUBJECT = (0.02, 3.0, 1.18)
FOCAL = 700 / WIDTH


def stage() -> Stage:
    """A vase at 3 m, bars and twigs at 1.1 to 1.6 m, a street of lamps from 7 m to 14 m."""
    cameras = handheld((-0.07, 0, 1.25), (0.07, 0.02, 1.24), (-0.02, 3, 1.2), (0.03, 3, 1.19), FOCAL, SEED)
    near, subject, far = np.random.default_rng(SEED).spawn(3)
    things = (*_far(far), *_subject(subject), *_near(near))
    return Stage(
        "bars", "thin bars and leaves in front of a sharp subject, far lights", cameras, things,
        focus=np.tile(SUBJECT, (len(cameras), 1)) - [0, 0.16, 0], air=(0.012, 0.016, 0.03),
    )  # fmt: skip


def _far(rng: np.random.Generator) -> list[Prop]:
    stones = textures.speckled(rng, (1024, 1024), (0.10, 0.10, 0.13), (0.42, 0.40, 0.42))
    places = np.array([(-4.2, 11.5, 4.5), (-1.4, 14.5, 6.0), (1.6, 13.0, 5.0),
                       (4.6, 11.0, 5.5), (7.0, 15.0, 6.0), (-6.6, 15.0, 6.5)])  # fmt: skip
    houses = [
        Prop(f"house {number}", box((2.6, 2.0, height)).moved(x, y, 0), _front(rng, (512, 384)))
        for number, (x, y, height) in enumerate(places)
    ]
    lamps = [
        sphere(0.045, 16).moved(x, y, z)
        for x, y, z in zip(
            rng.uniform(-3.6, 3.6, 22), rng.uniform(7.0, 10.0, 22), rng.uniform(0.5, 3.1, 22), strict=True
        )
    ]
    warm = np.broadcast_to(np.array((1.0, 0.80, 0.52), np.float32), (4, 4, 3))
    return [
        Prop("street", box((24, 18, 0.02)).moved(0, 9, -0.02), stones),
        *houses,
        Prop("lamps", join(lamps), warm, smooth=True, glow=6.0, layer=1),
    ]


def _front(rng: np.random.Generator, shape: tuple[int, int]) -> textures.Picture:
    """A house: plaster, and rows of windows, some lit."""
    height, width = shape
    picture = textures.speckled(rng, shape, rng.uniform(0.10, 0.25, 3), rng.uniform(0.35, 0.55, 3))
    rows, columns = 6, 4
    for row in range(rows):
        for column in range(columns):
            top, left = int((row + 0.22) * height / rows), int((column + 0.25) * width / columns)
            high, wide = int(0.55 * height / rows), int(0.5 * width / columns)
            lit = rng.random() < 0.35
            pane = np.array((0.95, 0.80, 0.45) if lit else (0.10, 0.12, 0.18)) * rng.uniform(0.8, 1.05)
            picture[top : top + high, left : left + wide] = pane
            picture[top : top + high, left + wide // 2 - 1 : left + wide // 2 + 2] = 0.25
    return picture


def _subject(rng: np.random.Generator) -> list[Prop]:
    outline = [(0.0, 0.0), (0.10, 0.0), (0.15, 0.10), (0.17, 0.22), (0.13, 0.34), (0.07, 0.42), (0.06, 0.48)]
    outline += [(0.09, 0.53), (0.07, 0.53), (0.0, 0.45)]
    x, y, z = SUBJECT
    vase = turned_body(outline, 64).moved(x, y, z - 0.22)
    post = textures.wood(rng, (512, 512), 4, (0.30, 0.20, 0.12), (0.62, 0.46, 0.30))
    return [
        Prop("vase", vase, textures.mug(rng, 320), smooth=True, layer=2),
        Prop("plinth", box((0.6, 0.6, z - 0.22)).turned(20).moved(x, y, 0), post, layer=2),
    ]


def _near(rng: np.random.Generator) -> list[Prop]:
    iron = textures.speckled(rng, (512, 32), (0.05, 0.06, 0.07), (0.42, 0.44, 0.46))
    iron[::40] = (0.7, 0.55, 0.2)
    height = np.linspace(0.4, 2.1, 24)[:, None]
    bars = []
    for x, y, lean in ((-0.43, 1.5, 0.05), (-0.24, 1.3, -0.08), (0.17, 1.15, 0.06), (0.42, 1.45, -0.04)):
        path = np.hstack([x + lean * (height - 1.2), np.full_like(height, y), height])
        rod = tube(path, 0.009, 12)
        bars.append(Shape(rod.vertices, rod.faces, rod.uv[..., ::-1]))
    twigs = []
    for number in range(22):
        foliage = leaf(
            rng.uniform(0.10, 0.18), rng.uniform(0.03, 0.05), rng.uniform(-0.02, 0.06), rng.uniform(0.0, 0.08)
        )
        turned = foliage.turned(rng.uniform(-60, 60), "x").turned(number * 137.5)
        right = number % 2
        twigs.append(turned.moved(
            rng.uniform(0.20, 0.48) if right else rng.uniform(-0.50, -0.22), rng.uniform(1.25, 1.6),
            rng.uniform(1.18, 1.55) if right else rng.uniform(1.0, 1.5),
        ))  # fmt: skip
    twigs = [Shape(each.vertices, each.faces, each.uv[..., ::-1]) for each in twigs]
    return [
        Prop("bars", join(bars), iron, smooth=True, layer=4),
        Prop("leaves", join(twigs), textures.foliage(rng, (256, 96)), smooth=True, layer=3),
    ]
