"""Three plainly painted things before a plain wall, from a camera that hardly moves.

A ball at 1.4 m, the subject, a vase, at 2 m, a cone at 2.7 m, on a plain table, a wall at 3.8 m. Paint runs
softly from tone to tone, with a handful of marks; the wall is faintly mottled. The camera's path is 1 % of
the subject's distance. Meant to be hard: there is little to track, and what there is hardly moves apart.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from . import textures
from .shapes import box, sphere, turned_body
from .stage import WIDTH, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 47
FOCAL = 640 / WIDTH
TABLE = 0.75
WALL = 3.8
SUBJECT = (0.03, 2.0)
"""x and y of the vase."""
MARK = 0.17
"""Height on the vase of its widest ring, and of the mark in focus."""
BELLY = 0.15


def stage() -> Stage:
    """Ball at 1.4 m, vase at 2 m, cone at 2.7 m, wall at 3.8 m."""
    ahead = (0.02, 2.0, TABLE + 0.20)
    cameras = handheld((-0.008, 0, 1.12), (0.008, 0.002, 1.12), ahead, ahead, FOCAL, SEED, shake=0.001)
    back, subject, others = np.random.default_rng(SEED).spawn(3)
    things = (*_back(back), *_things(subject, others))
    focus = np.array([SUBJECT[0], SUBJECT[1] - BELLY, TABLE + MARK])
    return Stage(
        "plain", "almost no texture and almost no parallax", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.3, 0.3, 0.3),
    )  # fmt: skip


def _mottled(
    rng: Generator, shape: tuple[int, int], dark: ArrayLike, light: ArrayLike, cells: tuple[float, float]
) -> Picture:
    """Plaster: a soft change of tone over everything, faint blotches in it."""
    slope = textures.noise(rng, shape, (2, 2), 1)
    blotches = textures.noise(rng, shape, cells, 4)
    return textures.ramp(0.7 * slope + 0.3 * blotches, dark, light)


def _painted(rng: Generator, shape: tuple[int, int], low: ArrayLike, high: ArrayLike) -> Picture:
    """Paint that runs from one tone below to another above, hardly uneven."""
    up = np.linspace(1, 0, shape[0], dtype=np.float32)[:, None]
    uneven = textures.noise(rng, shape, (4, 6), 2)
    return np.ascontiguousarray(textures.ramp(np.clip(0.88 * up + 0.12 * uneven, 0, 1), low, high))


def _mark(picture: Picture, across: float, down: float, size: int, ink: tuple[float, float, float]) -> None:
    """One brushed cross; the places are shares of the picture."""
    centre = round(across * picture.shape[1]), round(down * picture.shape[0])
    cv2.drawMarker(picture, centre, ink, cv2.MARKER_CROSS, size, max(2, size // 5), cv2.LINE_AA)


def _back(rng: Generator) -> list[Prop]:
    """The wall, and the table that reaches up to it."""
    wall = _mottled(rng, (320, 512), (0.52, 0.55, 0.56), (0.66, 0.67, 0.64), (9, 14))
    top = _mottled(rng, (384, 384), (0.46, 0.40, 0.36), (0.60, 0.54, 0.47), (12, 12))
    return [
        Prop("wall", box((5.2, 0.1, 2.6)).moved(0, WALL + 0.05, 0), wall),
        Prop("table", box((4.4, 3.2, 0.05)).moved(0, 2.2, TABLE - 0.05), top, layer=1),
    ]


def _things(subject: Generator, others: Generator) -> list[Prop]:
    """Vase, ball and cone; the textures' middle faces the camera."""
    glaze = _painted(subject, (320, 480), (0.18, 0.30, 0.42), (0.62, 0.72, 0.74))
    height = np.linspace(0, 0.44, 45)
    radius = BELLY - 0.05 + 0.05 * np.cos(np.pi * (height - MARK) / 0.22)
    outline = [(0.0, 0.0), *zip(radius, height, strict=True), (0.0, 0.40)]
    length = np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))
    ring = 1 - np.interp(MARK, height, length[:-1]) / length[-1]
    for across, down in ((0.5, ring), (0.40, ring - 0.12), (0.58, ring + 0.10), (0.62, ring - 0.2)):
        _mark(glaze, across, down, 11, (0.88, 0.84, 0.70))
    ball = _painted(others, (192, 384), (0.50, 0.16, 0.12), (0.84, 0.50, 0.36))
    for across, down in ((0.45, 0.42), (0.56, 0.55), (0.50, 0.68)):
        _mark(ball, across, down, 9, (0.20, 0.08, 0.08))
    cone = _painted(others, (256, 384), (0.58, 0.46, 0.16), (0.88, 0.80, 0.52))
    for across, down in ((0.47, 0.45), (0.55, 0.62), (0.42, 0.72)):
        _mark(cone, across, down, 11, (0.26, 0.30, 0.18))
    profile = [(0.0, 0.0), (0.20, 0.0), (0.20, 0.03), (0.03, 0.48), (0.0, 0.50)]
    return [
        Prop("cone", turned_body(profile, 64).moved(0.52, 2.72, TABLE), cone, smooth=True, layer=2),
        Prop("vase", turned_body(outline, 64).moved(*SUBJECT, TABLE), glaze, smooth=True, layer=3),
        Prop("ball", sphere(0.12).moved(-0.30, 1.42, TABLE + 0.12), ball, smooth=True, layer=4),
    ]
