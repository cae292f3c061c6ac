"""A long wall of posters that recedes to the right, and the floor along it: depth without a single jump.

The wall and the floor meet in one line; what hangs and lies on them is flat, so that nothing hides anything.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import cv2
import numpy as np

from . import textures
from .shapes import Shape
from .stage import WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

Paint = Callable[[Generator, tuple[int, int]], Picture]

SEED = 47
FOCAL = 700 / WIDTH
CORNER = np.array([-1.6, 2.0, 0.0])
"""Where the wall's coordinates begin: metres along it, out of it over the floor, and up."""
ALONG = np.array([np.sin(np.radians(33)), np.cos(np.radians(33)), 0.0])
OUT = np.array([ALONG[1], -ALONG[0], 0.0])
UP = np.array([0.0, 0.0, 1.0])
ENDS, HIGH, BROAD = (-0.35, 34.0), 4.4, 3.4
"""From where to where the wall runs, its height, and the floor's width, in metres."""
FOCUS = (3.05, 1.22)
"""Along the wall and up, in metres: on the middle one of the posters."""
FINE = 3
"""Bricks and planks are painted so many times finer and averaged: the far ones are smaller than a pixel."""


def stage() -> Stage:
    """Posters from 2.6 m at the left to 15 m at the right, rugs on the floor from 3.5 m, focus at 4.6 m."""
    cameras = handheld(
        (-0.18, 0, 1.62), (0.18, 0.06, 1.59), (0.02, 4.6, 0.78), (0.10, 4.6, 0.80), FOCAL, SEED
    )
    wall, floor, posters, rugs = np.random.default_rng(SEED).spawn(4)
    things = (
        Prop("wall", _receding(UP * HIGH), _bricks(wall, (448, 960))),
        Prop("floor", _receding(OUT * BROAD), _parquet(floor, (288, 640))),
        *_posters(posters),
        *_rugs(rugs),
    )
    focus = CORNER + FOCUS[0] * ALONG + FOCUS[1] * UP
    return Stage(
        "slope", "depth that only slopes: a receding wall and a floor, no jumps", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.2, 0.2, 0.2), sun=(0.45, -0.55, 0.75),
    )  # fmt: skip


# Shapes


def sheet(points: Floats) -> Shape:
    """A grid of points (rows, columns, 3) as quads, with the texture stretched evenly over its cells."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    return Shape(points.reshape(-1, 3), faces.astype(np.int32), uv[faces])


def _distances(count: int) -> Floats:
    """Metres along the wall that a camera at the origin sees at evenly spaced columns of its picture."""
    ends = CORNER + np.multiply.outer(ENDS, ALONG)
    first, last = (ends[:, 0] / ends[:, 1]).tolist()
    slope = np.linspace(first, last, count)
    return np.asarray((CORNER[0] - slope * CORNER[1]) / (slope * ALONG[1] - ALONG[0]))


def _receding(side: Floats) -> Shape:
    """The wall or the floor: cells and texture grow with the distance, so that they look even."""
    along = CORNER + np.multiply.outer(_distances(97), ALONG)
    return sheet(np.stack([along, along + side]))


def _flat(place: tuple[float, float], size: tuple[float, float], turn: float, upward: bool) -> Shape:
    """A rectangle on the wall, or on the floor, about (along, up or out), turned by degrees.

    It lies as thin as paper before the surface: no two surfaces share a place.
    """
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]]) / 2 * size
    a, b = corners[:, 0] * cos - corners[:, 1] * sin, corners[:, 0] * sin + corners[:, 1] * cos
    second, lift = (UP, OUT) if upward else (-OUT, UP)
    offset = place[1] if upward else -place[1]
    points = CORNER + 0.001 * lift + np.outer(place[0] + a, ALONG) + np.outer(offset + b, second)
    return sheet(points.reshape(2, 2, 3))


# Painting


def _bricks(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A brick wall with a mural over it: hills and suns of paint that let the bricks through."""
    height, width = shape[0] * FINE, shape[1] * FINE
    z = np.linspace(HIGH, 0, height, dtype=np.float32)[:, None]
    s = _distances(width).astype(np.float32)[None]
    course = np.floor(z / 0.085)
    brick = s / 0.26 + 0.5 * (course % 2)
    mortar = (z / 0.085 - course < 0.13) | (brick - np.floor(brick) < 0.045)
    tones = rng.random((64, 256), dtype=np.float32)
    tone = tones[course.astype(int) % 64, np.floor(brick).astype(int) % 256]
    picture = textures.ramp(tone, (0.36, 0.17, 0.13), (0.52, 0.28, 0.20), (0.66, 0.42, 0.30))
    wave = 0.95 + 0.35 * np.sin(1.3 * s + 0.6) + 0.2 * np.sin(3.1 * s)
    bands = np.floor((z - wave) / 0.34)
    paints = np.array([(0.20, 0.42, 0.52), (0.84, 0.66, 0.24), (0.76, 0.32, 0.22), (0.86, 0.80, 0.66)])
    paint = paints[np.clip(bands, 0, 3).astype(int)] * (0.75 + 0.5 * tone[..., None])
    picture = textures.mix(picture, paint, 0.8 * ((bands >= 0) & (bands < 4)))
    picture = textures.mix(picture, (0.72, 0.69, 0.62), 0.8 * mortar)
    picture = cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_AREA)
    grime = 0.55 * textures.noise(rng, shape, (5, 12), 6) + 0.45 * textures.noise(rng, shape, (150, 320), 2)
    return np.asarray(np.clip(picture * (0.72 + 0.5 * grime[..., None]), 0, 1), dtype=np.float32)


def _parquet(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Short planks across the wall's foot, each of its own tone."""
    height, width = shape[0] * FINE, shape[1] * FINE
    out = np.linspace(BROAD, 0, height, dtype=np.float32)[:, None]
    s = _distances(width).astype(np.float32)[None]
    row = np.floor(out / 0.14)
    plank = s / 0.62 + 0.37 * row
    seam = (out / 0.14 - row < 0.05) | (plank - np.floor(plank) < 0.012)
    tones = rng.random((64, 256), dtype=np.float32)
    tone = tones[row.astype(int) % 64, np.floor(plank).astype(int) % 256]
    picture = textures.ramp(tone, (0.34, 0.21, 0.12), (0.52, 0.35, 0.21), (0.68, 0.49, 0.31))
    picture = textures.mix(picture, (0.14, 0.09, 0.06), 0.8 * seam)
    picture = cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_AREA)
    grain = 0.5 * textures.noise(rng, shape, (60, 24), 4) + 0.5 * textures.noise(rng, shape, (140, 300), 1)
    return np.asarray(np.clip(picture * (0.7 + 0.6 * grain[..., None]), 0, 1), dtype=np.float32)


def poster(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A printed poster: a paper frame, bold figures, a big name and lines of small print."""
    height, width = shape
    inks = np.array(
        [(0.80, 0.22, 0.16), (0.16, 0.32, 0.50), (0.90, 0.70, 0.20), (0.16, 0.16, 0.18), (0.24, 0.48, 0.36),
         (0.88, 0.84, 0.74)]
    )  # fmt: skip
    ground, *others = rng.permutation(inks)
    picture = textures.ramp(textures.noise(rng, shape, (6, 6), 6), ground * 0.82, ground)
    picture = np.ascontiguousarray(picture)
    for number in range(9):
        ink = tuple(map(float, others[number % 5] * rng.uniform(0.85, 1.05)))
        x, y = int(width * rng.uniform(0.1, 0.9)), int(height * rng.uniform(0.08, 0.62))
        reach = int(width * rng.uniform(0.07, 0.24))
        if number % 3 == 0:
            cv2.circle(picture, (x, y), reach, ink, -1, cv2.LINE_AA)
            cv2.circle(picture, (x, y), reach // 2, tuple(map(float, others[number // 3])), -1, cv2.LINE_AA)
        elif number % 3 == 1:
            cv2.rectangle(picture, (x - reach, y - reach // 3), (x + reach, y + reach // 3), ink, -1)
        else:
            corners = np.array([(x - reach, y + reach), (x + reach, y + reach), (x, y - reach)])
            cv2.fillPoly(picture, [corners], ink, cv2.LINE_AA)
    _lettering(rng, picture, others[0] if abs(others[0] - ground).sum() > 0.7 else others[1])
    edge = max(height // 28, 3)
    for part in (np.s_[:edge], np.s_[-edge:], np.s_[:, :edge], np.s_[:, -edge:]):
        picture[part] = (0.90, 0.87, 0.80)
    return np.clip(picture * (0.85 + 0.25 * textures.noise(rng, shape, (30, 30), 4)[..., None]), 0, 1)


def _lettering(rng: Generator, picture: Picture, ink: Floats) -> None:
    """A bold name at three quarters of the height, small print below it."""
    height, width = picture.shape[:2]
    name = textures.word(rng, 2).upper()
    scale = 0.8 * width / cv2.getTextSize(name, textures.FONT, 1.0, 1)[0][0]
    for shift in (-1.5, -0.5, 0.5, 1.5):
        textures.write(picture, name, (width / 2 + shift, 0.74 * height), min(scale, height / 90), ink)
    for row in np.arange(0.85, 0.95, 14 / height):
        line = f"{textures.word(rng)} {textures.word(rng, 4)} {rng.integers(10, 99)}"
        scale = 0.8 * width / cv2.getTextSize(line, textures.FONT, 1.0, 1)[0][0]
        textures.write(picture, line, (width / 2, row * height), min(scale, 0.45), ink)


# What hangs and lies


def _posters(rng: Generator) -> list[Prop]:
    """Sheets beside each other and two high; the far ones need fewer pixels."""
    props, along = [], 0.25
    for number in range(22):
        wide, rows = rng.uniform(0.55, 0.85), ((1.10, 1.00), (1.99, 0.60)) if number % 3 else ((1.24, 1.20),)
        depth = 2.0 + 0.84 * along
        for row, (middle, tall) in enumerate(rows):
            scale = np.clip(900 / depth, 90, 330)
            shape = (max(round(tall * scale), 48), max(round(wide * scale), 40))
            paint = (poster, textures.postcard, poster, _engraving)[(number + 2 * row) % 4]
            place = (along + wide / 2, middle + rng.uniform(-0.05, 0.05))
            hung = _flat(place, (wide, tall), rng.uniform(-2.0, 2.0), upward=True)
            props.append(Prop(f"poster {number} {row}", hung, np.asarray(paint(rng, shape), np.float32)))
        along += wide + rng.uniform(0.10, 0.30)
    return props


def _engraving(rng: Generator, shape: tuple[int, int]) -> Picture:
    """An old print: a landscape in one ink on paper."""
    grey = textures.landscape(rng, shape).mean(axis=-1)
    low, high = np.percentile(grey, [2, 98])
    strokes = textures.noise(rng, shape, (shape[0] / 5, shape[1] / 12), 1)
    tone = np.clip((grey - low) / (high - low) + 0.25 * (strokes - 0.5), 0, 1).astype(np.float32)
    picture = textures.ramp(tone, (0.16, 0.12, 0.12), (0.62, 0.56, 0.48), (0.90, 0.86, 0.74))
    edge = max(shape[0] // 16, 3)
    for part in (np.s_[:edge], np.s_[-2 * edge :], np.s_[:, :edge], np.s_[:, -edge:]):
        picture[part] = (0.88, 0.84, 0.74)
    name = textures.word(rng).title()
    textures.write(picture, name, (shape[1] / 2, shape[0] - edge), edge / 24, (0.3, 0.1, 0.1))
    return picture


def _rugs(rng: Generator) -> list[Prop]:
    """Runners, prints and a map on the floor beside the wall."""
    red, blue, sand, green = (0.56, 0.18, 0.15), (0.20, 0.30, 0.46), (0.84, 0.77, 0.62), (0.26, 0.40, 0.28)
    weave = textures.cloth
    plan: tuple[tuple[float, float, float, float, float, Paint, float], ...] = (
        (2.75, 0.95, 1.15, 0.72, 8, partial(weave, ground=sand, figure=red), 260),
        (4.25, 0.72, 1.30, 0.80, -6, partial(weave, ground=blue, figure=sand), 240),
        (4.05, 1.75, 1.20, 0.80, 14, poster, 220),
        (6.10, 1.15, 1.70, 1.30, 4, partial(weave, ground=red, figure=sand), 180),
        (8.70, 0.90, 2.00, 1.20, -8, partial(weave, ground=green, figure=sand), 130),
        (6.70, 2.55, 1.80, 0.90, -5, textures.postcard, 160),
        (11.6, 1.30, 2.20, 1.60, 5, partial(weave, ground=sand, figure=blue), 110),
        (15.5, 1.20, 2.80, 1.60, -4, partial(weave, ground=red, figure=blue), 90),
    )
    return [
        Prop(f"rug {number}", _flat((along, out), (wide, deep), turn, upward=False),
             np.asarray(paint(rng, (round(deep * scale), round(wide * scale))), np.float32))
        for number, (along, out, wide, deep, turn, paint, scale) in enumerate(plan)
    ]  # fmt: skip
