"""Three black blocks in a row that leads away, walked past: the thesis's third video, of its chapter 5.

They stand on a workshop's floor at 1.7 m, 2.6 m and 4 m, in their scuffed paint with chalk and stencils, and
hide a little of each other in the first frame and not in the last. `focus_points` gives one to each, to rack
the focus through; the stage keeps to the second.
"""

from __future__ import annotations

import cv2
import numpy as np

from . import textures
from .boxes import printed_box
from .shapes import Shape, box, join, tube, turned_body
from .stage import WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture
from .walk import bricks, poster

SEED = 61
FOCAL = 680 / WIDTH
SIZE = (0.34, 0.34, 0.40)
"""Width, depth and height of a block in metres."""
PLACES = ((-0.33, 1.80, -24.0), (0.08, 2.65, 18.0), (0.62, 4.00, -31.0))
"""x, y and turn of the blocks, the nearest first."""
WALL = 6.6
FINE = 600
"""Pixels of paint a metre."""


def stage() -> Stage:
    """Blocks at 1.7, 2.6 and 4 m, crates and barrels at 4.9 to 6 m, a brick wall at 6.6 m."""
    cameras = handheld(
        (-0.15, -0.05, 0.66), (0.15, 0.06, 0.65), (0.0, 2.65, 0.23), (0.10, 2.65, 0.24), FOCAL, SEED
    )
    blocks, room, clutter = np.random.default_rng(SEED).spawn(3)
    things = (*_room(room), *_clutter(clutter), *_blocks(blocks))
    return Stage(
        "blocks", "three blocks at three depths, to be focused on in turn", cameras, things,
        focus=np.tile(focus_points()[1], (len(cameras), 1)), air=(0.2, 0.2, 0.2),
    )  # fmt: skip


def _block(place: tuple[float, float, float]) -> Shape:
    return printed_box(SIZE).turned(place[2]).moved(place[0], place[1], 0)


def focus_points() -> Floats:
    """(3, 3) a point on the front of each block in the world, the nearest first."""
    fronts = np.stack([_block(place).vertices[[0, 1, 4]] for place in PLACES])
    origin, right, top = fronts.transpose(1, 0, 2)
    return np.asarray(origin + 0.5 * (right - origin) + 0.55 * (top - origin))


def _paint(rng: Generator, number: int) -> Picture:
    """Black paint for a `printed_box`: brushed, worn to the wood at edges and corners, chalked."""
    front, tall = round(FINE * SIZE[0]), round(FINE * SIZE[2])
    shape = tall + front, 2 * front
    picture = textures.ramp(textures.noise(rng, shape, (6, 6), 6), (0.045, 0.045, 0.05), (0.17, 0.17, 0.18))
    brushed = textures.noise(rng, shape, (shape[0] / 40, shape[1] / 3), 2)
    picture *= (0.75 + 0.5 * brushed)[..., None]
    # The distance to the nearest edge of the sheet's four squares.
    row, column = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float32)
    up = np.where(row < front, np.minimum(row, front - row), np.minimum(row - front, shape[0] - 1 - row))
    across = np.minimum(column % front, front - column % front)
    edge = np.minimum(up, across)
    bare = textures.noise(rng, shape, (30, 30), 3) - 0.035 * edge > 0.28
    stain = textures.noise(rng, shape, (24, 24), 3) > 0.93
    wood = textures.wood(rng, shape, 2, (0.44, 0.30, 0.18), (0.78, 0.60, 0.40))
    picture = np.ascontiguousarray(textures.mix(picture, wood, bare | stain), dtype=np.float32)
    _marks(rng, picture[front:, :front], str(number))
    _marks(rng, picture[front:, front:], textures.word(rng, 1).upper())
    _marks(rng, picture[:front, :front], textures.word(rng, 1).upper())
    return np.clip(picture, 0, 1)


def _marks(rng: Generator, face: Picture, sign: str) -> None:
    """A stencilled sign in a ring, words and crosses of chalk, scratches."""
    height, width = face.shape[:2]
    chalk, red = (0.80, 0.80, 0.76), (0.70, 0.24, 0.16)
    for start in rng.uniform((0, 0), (width, height), (16, 2)):
        end = 0.75 * start + 0.25 * rng.uniform((0, 0), (width, height))
        tone = float(rng.uniform(0.3, 0.6))
        cv2.line(face, start.astype(int).tolist(), end.astype(int).tolist(), (tone,) * 3, 1, cv2.LINE_AA)
    middle = width // 2, round(0.40 * height)
    cv2.circle(face, middle, round(0.27 * width), red, 5, cv2.LINE_AA)
    for shift in np.arange(-2, 3):
        textures.write(face, sign, (middle[0] + shift, middle[1]), 3.2 / len(sign) ** 0.7, chalk)
    for _ in range(3):
        x, y = rng.uniform((0.14 * width, 0.1 * height), (0.86 * width, 0.9 * height))
        cv2.drawMarker(face, (round(x), round(y)), chalk, cv2.MARKER_TILTED_CROSS, 14, 2)
    textures.write(
        face, f"{textures.word(rng, 2)} {rng.integers(10, 99)}", (width / 2, 0.82 * height), 0.8, chalk
    )


def _blocks(rng: Generator) -> list[Prop]:
    return [
        Prop(f"block {number}", _block(place), _paint(each, number), layer=5 - number)
        for number, (place, each) in enumerate(zip(PLACES, rng.spawn(3), strict=True), start=1)
    ]


def _floor(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Concrete in slabs, with cracks, spills of paint and chalk, and yellow lines."""
    height, width = shape
    row, column = np.mgrid[0:height, 0:width].astype(np.float32)
    picture = textures.ramp(textures.noise(rng, shape, (9, 7), 7), (0.34, 0.32, 0.30), (0.66, 0.64, 0.58))
    grit = textures.noise(rng, shape, (height / 4, width / 4), 2)
    picture = textures.mix(picture, (0.16, 0.15, 0.15), 0.7 * (grit > 0.86))
    picture = textures.mix(picture, (0.86, 0.83, 0.76), 0.7 * (grit < 0.12))
    ridge = np.abs(textures.noise(rng, shape, (7, 6), 5) - 0.5) < 0.006
    joint = (row % (height / 6) < 2) | (column % (width / 5) < 2)
    picture = textures.mix(picture, (0.15, 0.14, 0.13), 0.8 * (ridge | joint))
    picture = np.ascontiguousarray(picture, dtype=np.float32)
    for _ in range(120):
        x, y, size = rng.uniform((0, 0, 2), (width, height, 7))
        colour = tuple(map(float, rng.uniform(0.1, 0.85, 3)))
        cv2.circle(picture, (round(x), round(y)), round(size), colour, -1, cv2.LINE_AA)
    worn = textures.noise(rng, shape, (60, 60), 3) > 0.35
    line = (np.abs(column - 0.30 * width) < 0.012 * width) | (np.abs(row - 0.28 * height) < 0.012 * height)
    return textures.mix(picture, (0.84, 0.68, 0.16), 0.85 * (line & worn))


def _room(rng: Generator) -> list[Prop]:
    """The floor, and a brick wall with posters."""
    wall = bricks(rng, (288, 704), 24, 26, (0.72, 0.42, 0.32))
    props = [
        Prop("floor", box((6.4, 6.6, 0.1)).moved(0, 3.8, -0.1), _floor(rng, (768, 736))),
        Prop("wall", box((8.0, 0.1, 3.0)).moved(0, WALL + 0.05, 0), wall),
    ]
    sheets = (
        (-1.75, 0.95, (0.92, 0.90, 0.84)),
        (-0.70, 1.05, (0.84, 0.66, 0.26)),
        (1.85, 1.0, (0.30, 0.44, 0.50)),
    )
    for number, (x, z, paper) in enumerate(sheets):
        sheet = box((0.62, 0.02, 0.80)).moved(x, WALL - 0.01, z - 0.1)
        props.append(Prop(f"poster {number}", sheet, poster(rng, (168, 130), paper, (0.12, 0.10, 0.12))))
    return props


def _clutter(rng: Generator) -> list[Prop]:
    """Before the wall: crates, barrels, a plank that leans, a bucket."""
    crate = textures.wood(rng, (192, 192), 5, (0.40, 0.26, 0.14), (0.80, 0.62, 0.40))
    crate[:, :14] = crate[:, -14:] = crate[:14].swapaxes(0, 1) * np.float32(0.8)
    for row in (20, 160):
        textures.write(crate, textures.word(rng).upper(), (96, row), 0.9, (0.20, 0.12, 0.10))
    places = (
        (-1.55, 5.7, 0.0, 12),
        (-0.98, 5.9, 0.0, -9),
        (-1.30, 5.8, 0.5, 31),
        (1.75, 5.6, 0.0, -20),
        (1.62, 5.65, 0.5, 8),
    )
    crates = [box((0.5, 0.5, 0.5)).turned(turn).moved(x, y, z) for x, y, z, turn in places]
    drum = [(0.0, 0.0), (0.27, 0.0), (0.27, 0.27), (0.285, 0.29), (0.27, 0.31), (0.27, 0.58), (0.285, 0.60)]
    drum += [(0.27, 0.62), (0.27, 0.88), (0.0, 0.88)]
    pail = [(0.0, 0.0), (0.12, 0.0), (0.16, 0.28), (0.17, 0.28), (0.0, 0.06)]
    rods = [
        tube(np.array([[x, 5.9, 0.0], [x + 0.1, 6.2, 0.9], [x + 0.2, 6.5, 1.8]]), 0.03, 12)
        for x in (0.75, 1.0)
    ]
    rods = [Shape(rod.vertices, rod.faces, rod.uv[..., ::-1]) for rod in rods]
    paint, rust = (
        textures.mug(rng, 160),
        textures.cloth(rng, (256, 64), (0.62, 0.50, 0.20), (0.20, 0.18, 0.16)),
    )
    drums = [turned_body(drum).moved(x, y, 0) for x, y in ((-0.18, 5.8), (2.5, 5.3))]
    pail_there = turned_body(pail).moved(-0.62, 5.1, 0)
    blue = np.array((0.30, 0.62, 0.86), np.float32)
    return [
        Prop("crates", join(crates), crate, layer=1),
        Prop("drums", join(drums), paint * blue, smooth=True, layer=1),
        Prop("pail", pail_there, paint[::-1] * np.float32(0.8), smooth=True, layer=1),
        Prop("poles", join(rods), rust, smooth=True, layer=1),
    ]
