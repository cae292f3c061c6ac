"""The things of the desk scene: which shapes stand where, and what is painted on them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .stage import Prop

GLOBE_RADIUS = 0.175
TABLE = 0.74
"""Height of the table's top."""
GLOBE_CENTRE = (0.06, 2.0, TABLE + 0.30)
WALL = 7.0
"""Distance of the back wall from the camera."""


def furnish(seed: int) -> Iterator[Prop]:
    """Everything there is to see, the same for the same seed."""
    # A generator for each part of the room: a change to one leaves the others as they are.
    table, subject, near, behind, room, wall = np.random.default_rng(seed).spawn(6)
    yield from _table(table)
    yield from _globe(subject)
    yield from _mug(near)
    yield from _behind(behind)
    yield from _room(room)
    yield from _wall(wall)


def _table(rng: np.random.Generator) -> Iterator[Prop]:
    planks = textures.wood(rng, (1536, 1024), 7, (0.36, 0.21, 0.11), (0.66, 0.45, 0.27))
    yield Prop("table", box((1.7, 2.5, 0.05)).moved(0, 1.85, TABLE - 0.05), planks, roughness=0.5)
    runner = textures.cloth(rng, (1536, 448), (0.80, 0.75, 0.63), (0.58, 0.22, 0.18))
    yield Prop("runner", box((0.52, 2.2, 0.004)).turned(4).moved(0.05, 1.9, TABLE), runner, roughness=0.9)
    book = box((0.42, 0.30, 0.018)).turned(-24).moved(0.44, 1.72, TABLE + 0.004)
    yield Prop("open book", book, textures.page(rng, (512, 768)))
    for number, (x, y, turn) in enumerate(
        ((-0.40, 1.86, 24), (-0.31, 1.64, -11), (0.50, 1.30, 14), (-0.60, 2.25, 65), (-0.12, 1.36, 38))
    ):
        card = box((0.148, 0.105, 0.002)).turned(turn).moved(x, y, TABLE + 0.004 + 0.001 * number)
        yield Prop(f"postcard {number}", card, textures.postcard(rng, (210, 296)))


def _globe(rng: np.random.Generator) -> Iterator[Prop]:
    ball = sphere(GLOBE_RADIUS).turned(-82).turned(18, "y").moved(*GLOBE_CENTRE)
    yield Prop("globe", ball, textures.globe(rng, 640), smooth=True, roughness=0.45)
    brass = textures.speckled(rng, (64, 64), (0.46, 0.33, 0.14), (0.80, 0.62, 0.32))
    angles = np.radians(np.linspace(-100, 100, 48))
    arc = (GLOBE_RADIUS + 0.016) * np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], axis=1)
    arm = tube(arc, 0.009).turned(-72, "y").moved(*GLOBE_CENTRE)
    yield Prop("meridian", arm, brass, smooth=True, roughness=0.35)
    foot = [(0.0, 0.0), (0.125, 0.0), (0.125, 0.016), (0.10, 0.03), (0.05, 0.04), (0.026, 0.06)]
    foot += [(0.02, 0.08), (0.028, 0.09), (0.018, 0.108), (0.0, 0.112)]
    turned = textures.wood(rng, (256, 512), 8, (0.22, 0.11, 0.06), (0.50, 0.28, 0.15))
    yield Prop("foot", turned_body(foot).moved(GLOBE_CENTRE[0], 2.0, TABLE + 0.004), turned, smooth=True)


def _mug(rng: np.random.Generator) -> Iterator[Prop]:
    """A mug with pencils at the left, nearest to the camera: thin things over everything else."""
    x, y = -0.335, 1.23
    outline = [(0.0, 0.0), (0.044, 0.0), (0.05, 0.006), (0.053, 0.02), (0.053, 0.125), (0.055, 0.13)]
    outline += [(0.051, 0.131), (0.048, 0.12), (0.047, 0.02), (0.0, 0.015)]
    glaze = textures.mug(rng, 256)
    yield Prop("mug", turned_body(outline, 64).moved(x, y, TABLE), glaze, smooth=True, roughness=0.4)
    angles = np.radians(np.linspace(-95, 95, 24))
    grip = 0.036 * np.stack([np.cos(angles), 0 * angles, 1.15 * np.sin(angles)], axis=1)
    yield Prop("handle", tube(grip, 0.007).moved(x + 0.05, y, TABLE + 0.07), glaze[:128, :128], smooth=True)
    inks = (
        (0.72, 0.20, 0.14),
        (0.90, 0.66, 0.18),
        (0.18, 0.36, 0.52),
        (0.28, 0.46, 0.26),
        (0.34, 0.20, 0.14),
    )
    for number, ink in enumerate(inks):
        turn = 2 * np.pi * (number / len(inks)) + 0.5
        foot = np.array([0.02 * np.cos(turn + 2.6), 0.02 * np.sin(turn + 2.6), 0.02])
        head = np.array([0.052 * np.cos(turn), 0.052 * np.sin(turn), 0.195 + 0.012 * rng.integers(5)])
        path = foot + (head - foot) * np.linspace(0, 1, 8)[:, None]
        coat = textures.speckled(rng, (128, 64), np.array(ink) * 0.8, ink)
        coat[:, ::16] *= 0.6
        coat[:14] = (0.20, 0.18, 0.18)
        coat[14:22] = (0.80, 0.74, 0.60)
        pencil = tube(path, 0.0042, 8).moved(x, y, TABLE)
        # The texture's height runs along the rod.
        yield Prop(f"pencil {number}", Shape(pencil.vertices, pencil.faces, pencil.uv[..., ::-1]), coat, True)


def _behind(rng: np.random.Generator) -> Iterator[Prop]:
    """Books and a clock at the right of the table's far end, an earthen jug at its left."""
    spines = textures.book_spines(rng, 12)
    pile, height = [], TABLE
    for number, thick in enumerate((0.05, 0.036, 0.06, 0.042)):
        # A lying book is a standing one on its side: the spine, its front, still faces the camera.
        book = box((thick, 0.24, 0.34), (number / 12, 0, (number + 1) / 12, 1), 0.08).moved(0, 0, -0.17)
        lying = book.turned(-90, "y").turned(rng.uniform(-9, 9))
        pile.append(lying.moved(0.60, 2.72, height + thick / 2))
        height += thick
    yield Prop("pile of books", join(pile), spines)
    brass = textures.speckled(rng, (64, 64), (0.30, 0.12, 0.10), (0.62, 0.26, 0.20))
    drum = turned_body([(0.0, 0.0), (0.085, 0.0), (0.092, 0.008), (0.092, 0.06), (0.0, 0.065)])
    drum = drum.turned(-90, "x").turned(-14).moved(0.585, 2.65, height + 0.105)
    bells = [sphere(0.03, 24).moved(0.585 + side, 2.67, height + 0.205) for side in (-0.045, 0.045)]
    feet = [box((0.014, 0.03, 0.03)).moved(0.585 + side, 2.67, height) for side in (-0.05, 0.05)]
    yield Prop("alarm clock", join([drum, *bells, *feet]), brass, smooth=True, roughness=0.4)
    dial = box((0.168, 0.002, 0.168)).moved(0, 0, -0.084)
    dial = _round(dial.moved(0, -0.002, 0), 0.084).turned(-14).moved(0.585, 2.65, height + 0.105)
    yield Prop("dial", dial, textures.clock_face(rng, 320))
    jug = [(0.0, 0.0), (0.07, 0.0), (0.10, 0.05), (0.115, 0.12), (0.10, 0.19), (0.055, 0.25)]
    jug += [(0.045, 0.30), (0.06, 0.33), (0.05, 0.33), (0.036, 0.30), (0.0, 0.28)]
    clay = textures.mug(rng, 256)[:, ::-1] * (0.86, 0.70, 0.58)
    yield Prop("jug", turned_body(jug).moved(-0.52, 2.75, TABLE), clay.astype(np.float32), smooth=True)


def _round(plate: Shape, radius: float) -> Shape:
    """A disc facing -y in place of a square plate's front, its texture cut to the circle."""
    angles = np.linspace(0, 2 * np.pi, 49)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    y = plate.vertices[:, 1].min()
    count = len(angles)
    circle = np.stack([radius * rim[:, 0], np.full(count, y), radius * rim[:, 1]], axis=1)
    middle = np.tile([[0.0, y, 0.0]], (count, 1)) + 1e-3 * (circle - [0.0, y, 0.0])
    first = np.arange(count - 1)
    faces = np.stack([first + count, first, first + 1, first + 1 + count], axis=1).astype(np.int32)
    vertices = np.concatenate([circle, middle])
    uv = 0.5 + 0.5 * vertices[:, [0, 2]] / radius
    return Shape(vertices, faces, uv[faces])


def _room(rng: np.random.Generator) -> Iterator[Prop]:
    """Between table and wall: a slatted chair, a plant, the floor."""
    boards = textures.wood(rng, (1024, 1024), 16, (0.28, 0.19, 0.12), (0.52, 0.38, 0.25))
    yield Prop("floor", box((9.0, 9.0, 0.02)).moved(0, 4.0, -0.02), boards)
    stained = textures.wood(rng, (512, 256), 3, (0.34, 0.20, 0.10), (0.72, 0.50, 0.28))
    posts = [box((0.045, 0.045, 1.16)).moved(side, 0, 0) for side in (-0.21, 0.21)]
    rails = [box((0.42, 0.03, 0.07)).moved(0, 0, z) for z in (0.62, 1.07)]
    slats = [box((0.035, 0.018, 0.40)).moved(side, 0, 0.68) for side in (-0.14, -0.07, 0.0, 0.07, 0.14)]
    seat = box((0.46, 0.44, 0.04)).moved(0, -0.22, 0.44)
    chair = join([*posts, *rails, *slats, seat]).turned(16).moved(-0.62, 3.55, 0)
    yield Prop("chair", chair, stained)
    clay = textures.speckled(rng, (128, 256), (0.46, 0.22, 0.14), (0.76, 0.46, 0.32))
    pot = turned_body(
        [(0.0, 0.0), (0.13, 0.0), (0.18, 0.30), (0.20, 0.30), (0.20, 0.34), (0.15, 0.34), (0.0, 0.30)]
    )
    stand = box((0.34, 0.34, 0.46)).moved(0, 0, 0)
    x, y = 1.55, 4.4
    yield Prop("pot", pot.moved(x, y, 0.46), clay, smooth=True)
    yield Prop("stand", stand.moved(x, y, 0), stained)
    leaves = [
        leaf(rng.uniform(0.4, 0.7), rng.uniform(0.10, 0.17), rng.uniform(0.5, 1.0), rng.uniform(0.2, 0.6))
        .turned(number * 137.5)
        .moved(x, y, 0.74)
        for number in range(26)
    ]
    leaves = [Shape(each.vertices, each.faces, each.uv[..., ::-1]) for each in leaves]
    yield Prop("leaves", join(leaves), textures.foliage(rng, (256, 96)), smooth=True)


def _wall(rng: np.random.Generator) -> Iterator[Prop]:
    yield Prop(
        "wall", box((7.5, 0.1, 3.75)).moved(0, WALL + 0.05, 0), textures.wallpaper(rng, 2048), roughness=0.9
    )
    stained = textures.wood(rng, (512, 256), 3, (0.22, 0.13, 0.08), (0.46, 0.30, 0.18))
    left, wide, deep, step, boards = -1.62, 2.7, 0.32, 0.40, 6
    shelves = [box((wide, deep, 0.035)).moved(left, 0, 0.1 + step * k) for k in range(boards)]
    sides = [box((0.04, deep, 0.135 + step * (boards - 1))).moved(left + s * wide / 2, 0, 0) for s in (-1, 1)]
    back = box((wide, 0.02, 2.1)).moved(left, deep / 2, 0)
    yield Prop("bookcase", join([*shelves, *sides, back]).moved(0, WALL - 0.2, 0), stained)
    spines, books = 24, []
    for shelf in range(boards):
        x = left - wide / 2 + 0.03
        while (thick := rng.uniform(0.03, 0.075)) and x + thick < left + wide / 2 - 0.03:
            pick, tall = rng.integers(spines), rng.uniform(0.22, 0.33)
            book = box((thick, 0.2, tall), (pick / spines, 0, (pick + 1) / spines, 1), 0.08)
            lean = rng.uniform(-0.03, 0.02)
            books.append(book.moved(x + thick / 2, WALL - 0.22 + lean, 0.135 + step * shelf))
            x += thick + (0.12 if rng.random() < 0.06 else 0.002)
    yield Prop("books", join(books), textures.book_spines(rng, spines))
    gilt = textures.speckled(rng, (128, 128), (0.34, 0.24, 0.12), (0.70, 0.54, 0.30))
    for number, (x, z, width, height) in enumerate(
        ((0.62, 1.62, 0.95, 0.68), (1.62, 1.98, 0.62, 0.50), (2.35, 1.5, 0.5, 0.72), (0.42, 1.06, 0.42, 0.32))
    ):
        frame = box((width + 0.1, 0.04, height + 0.1)).moved(x, WALL - 0.02, z - height / 2 - 0.05)
        yield Prop(f"frame {number}", frame, gilt)
        painting = box((width, 0.01, height)).moved(x, WALL - 0.045, z - height / 2)
        yield Prop(f"painting {number}", painting, textures.landscape(rng, (320, int(320 * width / height))))
    yield from _lamps(rng)


def _lamps(rng: np.random.Generator) -> Iterator[Prop]:
    """A standing lamp, and a string of small bright ones, whose discs tell a lens from a blur."""
    brass = textures.speckled(rng, (64, 64), (0.30, 0.24, 0.14), (0.60, 0.48, 0.28))
    pole = turned_body([(0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.014, 0.03), (0.014, 1.4)], 16)
    yield Prop("pole", pole.moved(1.45, 6.3, 0), brass, smooth=True)
    silk = textures.ramp(textures.noise(rng, (96, 256), (3, 40), 4), (0.78, 0.50, 0.26), (0.98, 0.78, 0.50))
    shade = turned_body([(0.24, 0.0), (0.16, 0.30)], 32).moved(1.45, 6.3, 1.28)
    yield Prop("shade", shade, silk, smooth=True, glow=0.9)
    x = np.linspace(-2.9, 2.7, 19)
    sag = 2.04 - 0.11 * np.abs(np.sin(np.pi * np.arange(19) / 6)) + rng.uniform(-0.01, 0.01, 19)
    bulbs = [sphere(0.016, 12).moved(a, WALL - 0.42, b) for a, b in zip(x, sag, strict=True)]
    warm = np.broadcast_to(np.array((1.0, 0.86, 0.62), np.float32), (4, 4, 3))
    yield Prop("string of lamps", join(bulbs), warm, glow=4.0)
    cord = tube(np.stack([x, np.full(19, WALL - 0.41), sag + 0.02], axis=1), 0.005, 6)
    yield Prop("cord", cord, brass * np.float32(0.4))
