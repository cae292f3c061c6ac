"""A potted plant in focus before a busy room: leaves and hair-thin grass over books and posters."""

from __future__ import annotations

import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .slope import poster, sheet
from .stage import WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 73
FOCAL = 700 / WIDTH
PLANT = np.array([0.0, 1.5])
"""Where the plant stands, x and y."""
TOP, RIM = 0.93, 1.07
"""Heights of the table's top and of the pot's rim."""
WALL = 5.7
HEART = np.array([0.035, 1.42, 1.31])
"""The middle of the flower in focus."""
SQUEEZE = 0.45
"""The plant is flatter than it is wide, as one by a wall is, so that most of it is sharp."""


def stage() -> Stage:
    """A table with the plant at 1.3 to 1.7 m, lights at 4.6 m, furniture and wall at 5 to 5.7 m."""
    cameras = handheld(
        (-0.08, 0, 1.30), (0.08, 0.02, 1.27), (0.0, 1.45, 1.245), (0.0, 1.45, 1.235), FOCAL, SEED
    )
    room, furniture, lights, table, plant = np.random.default_rng(SEED).spawn(5)
    things = (*_room(room), *_furniture(furniture), *_lights(lights), *_table(table), *_plant(plant))
    heart = _heart()
    # On the near side of the flower's heart, beside the pole, where the mesh has a pinhole.
    focus = HEART + heart.vertices[heart.faces[len(heart.faces) * 2 // 3]].mean(axis=0)
    return Stage(
        "foreground", "leaves and hair-thin grass in focus before a busy background", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.1, 0.1, 0.1),
    )  # fmt: skip


def _lengthwise(shape: Shape) -> Shape:
    """Rods and leaves with the texture's height along them."""
    return Shape(shape.vertices, shape.faces, shape.uv[..., ::-1])


# The room


def _room(rng: Generator) -> list[Prop]:
    """A papered wall with posters, a floor with a rug."""
    boards = textures.wood(rng, (256, 320), 18, (0.26, 0.17, 0.10), (0.52, 0.37, 0.23))
    rug = textures.cloth(rng, (192, 256), (0.54, 0.20, 0.17), (0.84, 0.76, 0.60))
    props = [
        Prop("floor", box((9.0, 8.0, 0.02)).moved(0, 2.5, -0.02), boards),
        Prop("rug", box((3.2, 1.6, 0.01)).turned(-4).moved(0.9, 4.0, 0), rug),
        Prop("wall", box((8.0, 0.1, 3.4)).moved(0, WALL + 0.05, 0), textures.wallpaper(rng, 640)),
    ]
    plan = ((-0.52, 1.62, 0.62, 0.86), (0.26, 1.98, 0.66, 0.50), (1.05, 1.74, 0.60, 0.84),
            (1.75, 2.02, 0.55, 0.74), (2.42, 1.70, 0.52, 0.74), (0.28, 1.42, 0.50, 0.40))  # fmt: skip
    for number, (x, z, wide, tall) in enumerate(plan):
        shape = (round(170 * tall), round(170 * wide))
        print_ = poster(rng, shape) if tall > wide else textures.postcard(rng, shape)
        props.append(
            Prop(f"poster {number}", box((wide, 0.012, tall)).moved(x, WALL - 0.01, z - tall / 2), print_)
        )
    return props


def _furniture(rng: Generator) -> list[Prop]:
    """A bookcase at the left, a sideboard at the right, and everything that stands on them."""
    stained = textures.wood(rng, (192, 192), 5, (0.22, 0.13, 0.08), (0.50, 0.33, 0.20))
    panels = textures.wood(rng, (192, 512), 9, (0.28, 0.18, 0.11), (0.62, 0.44, 0.28))
    left, wide, step, boards = -1.95, 2.0, 0.36, 7
    shelves = [box((wide, 0.3, 0.035)).moved(left, 0, 0.08 + step * number) for number in range(boards)]
    sides = [
        box((0.04, 0.3, 0.12 + step * (boards - 1))).moved(left + side * wide / 2, 0, 0) for side in (-1, 1)
    ]
    back = box((wide, 0.02, 0.1 + step * (boards - 1))).moved(left, 0.14, 0)
    board = [box((2.5, 0.42, 0.05)).moved(1.45, 0, 0.72), box((2.4, 0.38, 0.72)).moved(1.45, 0.02, 0)]
    things = [
        Prop("bookcase", join([*shelves, *sides, back]).moved(0, WALL - 0.17, 0), stained, layer=1),
        Prop("sideboard", join(board).moved(0, WALL - 0.24, 0), panels, layer=1),
        _books(rng, left, wide, step, boards),
        *_crockery(rng),
    ]
    return things


def _books(rng: Generator, left: float, wide: float, step: float, boards: int) -> Prop:
    spines, books = 20, []
    for shelf in range(boards):
        x = left - wide / 2 + 0.03
        while (thick := rng.uniform(0.025, 0.065)) and x + thick < left + wide / 2 - 0.03:
            pick, tall = rng.integers(spines), rng.uniform(0.20, 0.31)
            book = box((thick, 0.2, tall), (pick / spines, 0, (pick + 1) / spines, 1), 0.08)
            lean = rng.uniform(-0.03, 0.02)
            books.append(book.moved(x + thick / 2, WALL - 0.2 + lean, 0.115 + step * shelf))
            x += thick + (0.10 if rng.random() < 0.06 else 0.002)
    return Prop("books", join(books), textures.book_spines(rng, spines, (224, 36)), layer=1)


def _crockery(rng: Generator) -> list[Prop]:
    """Jars, vases and a leaning plate on the sideboard."""
    profiles = (
        [
            (0.0, 0.0),
            (0.08, 0.0),
            (0.12, 0.10),
            (0.13, 0.20),
            (0.08, 0.30),
            (0.06, 0.36),
            (0.08, 0.38),
            (0.0, 0.34),
        ],
        [(0.0, 0.0), (0.09, 0.0), (0.095, 0.03), (0.095, 0.20), (0.07, 0.23), (0.075, 0.25), (0.0, 0.28)],
        [(0.0, 0.0), (0.05, 0.0), (0.055, 0.20), (0.02, 0.28), (0.018, 0.38), (0.024, 0.40), (0.0, 0.40)],
        [(0.0, 0.0), (0.10, 0.0), (0.16, 0.09), (0.19, 0.16), (0.185, 0.16), (0.0, 0.04)],
    )
    glazes = [textures.mug(rng, 96) * np.float32(shade) for shade in (1.0, 0.7, 0.85)]
    tints = np.array([(1.0, 0.95, 0.85), (0.75, 0.95, 1.05), (1.05, 0.75, 0.6)], np.float32)
    props, x = [], 0.38
    for number in range(8):
        shape = turned_body(profiles[number % 4], 28).turned(50 * number)
        x += 0.06 + np.ptp(shape.vertices[:, 0]) / 2
        picture = np.clip(glazes[number % 3] * tints[(number // 2) % 3], 0, 1)
        place = shape.moved(x, WALL - 0.28 + rng.uniform(-0.05, 0.05), 0.77)
        props.append(Prop(f"crockery {number}", place, picture, smooth=True, layer=1))
        x += np.ptp(shape.vertices[:, 0]) / 2
    return props


def _lights(rng: Generator) -> list[Prop]:
    """A sagging string of small lamps across the room."""
    x = np.linspace(-2.4, 2.4, 15)
    z = 2.06 - 0.16 * np.abs(np.sin(np.pi * np.arange(15) / 5)) + rng.uniform(-0.02, 0.02, 15)
    bulbs = [sphere(0.02, 12).moved(a, 4.6, b) for a, b in zip(x, z, strict=True)]
    warm = np.broadcast_to(np.array((1.0, 0.82, 0.55), np.float32), (4, 4, 3))
    cord = tube(np.stack([x, np.full(15, 4.61), z + 0.025], axis=1), 0.005, 6)
    black = textures.speckled(rng, (32, 32), (0.05, 0.05, 0.05), (0.16, 0.15, 0.14))
    return [
        Prop("lamps", join(bulbs), warm, smooth=True, glow=6.0, layer=2),
        Prop("cord", cord, black, layer=2),
    ]


# The subject


def _table(rng: Generator) -> list[Prop]:
    # Planks along the table.
    planks = textures.wood(rng, (512, 192), 4, (0.38, 0.23, 0.12), (0.70, 0.49, 0.30)).swapaxes(0, 1)
    runner = textures.cloth(rng, (320, 160), (0.86, 0.80, 0.66), (0.24, 0.36, 0.50))
    table = box((1.7, 0.62, 0.05)).moved(PLANT[0], PLANT[1] + 0.02, TOP - 0.053)
    cloth = box((0.42, 0.60, 0.003)).turned(3).moved(PLANT[0], PLANT[1] + 0.02, TOP - 0.003)
    return [Prop("table", table, planks, layer=2), Prop("runner", cloth, runner, layer=2)]


def _plant(rng: Generator) -> list[Prop]:
    outline = [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.066, 0.008),
        (0.088, 0.115),
        (0.098, 0.118),
        (0.10, 0.14),
        (0.09, 0.14),
    ]
    outline += [(0.086, 0.125), (0.0, 0.12)]
    pot = turned_body(outline, 56).moved(PLANT[0], PLANT[1], TOP)
    leaves, stalks = _leaves(rng)
    heads = _flower_heads(rng)
    stems = [_stem(np.array([*PLANT, RIM - 0.02]), head - [0, -0.008, 0.004], 0.0026) for head in heads]
    green, petal = textures.foliage(rng, (192, 72)), _petal(rng, (96, 32))
    straw = textures.speckled(rng, (96, 8), (0.24, 0.34, 0.12), (0.66, 0.70, 0.34))
    back, front = ([each for each in leaves if (_side(each) > 0.03) == behind] for behind in (True, False))
    return [
        Prop("leaves behind", join(back), green, smooth=True, layer=3),
        Prop("pot", pot, textures.mug(rng, 176), smooth=True, layer=4),
        Prop("stalks", join([*stalks, *stems]), straw, smooth=True, layer=5),
        Prop("leaves", join(front), green[:, ::-1], smooth=True, layer=5),
        Prop("grass", join(_grass(rng)), straw, layer=5),
        Prop("petals", join([_corolla(rng, head) for head in heads]), petal, smooth=True, layer=5),
        Prop(
            "hearts", join([_heart().moved(*head) for head in heads]), _seeds(rng, 96), smooth=True, layer=5
        ),
    ]


def _side(leaf_: Shape) -> float:
    """How far behind the plant's middle a leaf is, in metres."""
    return float(leaf_.vertices[:, 1].mean() - PLANT[1])


def _planted(shape: Shape) -> Shape:
    """From around the origin to the plant's place, flattened in depth."""
    return Shape(shape.vertices * [1, SQUEEZE, 1], shape.faces, shape.uv).moved(PLANT[0], PLANT[1], 0)


def _stem(foot: Floats, head: Floats, radius: float) -> Shape:
    """A stalk that leaves the pot upright and bends over to its head."""
    share = np.linspace(0, 1, 14)[:, None]
    path = foot + (head - foot) * np.hstack([share**1.8, share**1.8, share])
    return _lengthwise(tube(path, radius, 6))


def _leaves(rng: Generator) -> tuple[list[Shape], list[Shape]]:
    """Leaves that arch out of the pot all around, and their stalks."""
    leaves, stalks = [], []
    for number in range(52):
        around, reach = 137.5 * number, rng.uniform(0.04, 0.17)
        height = RIM + rng.uniform(0.02, 0.32)
        size = rng.uniform((0.12, 0.035, 0.0, 0.03), (0.21, 0.065, 0.12, 0.15))
        blade = leaf(*size)
        turn = np.radians(around)
        foot = np.array([reach * np.cos(turn), reach * np.sin(turn), height])
        placed = _planted(_lengthwise(blade).turned(rng.uniform(-30, 30), "x").turned(around).moved(*foot))
        if np.hypot(*(placed.vertices - HEART)[:, [0, 2]].T).min() < 0.07:
            continue  # it might hide what is in focus
        leaves.append(placed)
        tip = foot * [1, SQUEEZE, 1] + [*PLANT, 0]
        stalks.append(_stem(np.array([*PLANT, RIM - 0.03]), tip, 0.0018))
    return leaves, stalks


def _grass(rng: Generator) -> list[Shape]:
    """Blades one to three millimetres wide, half a pixel to a pixel and a half, that arch over."""
    blades, share = [], np.linspace(0, 1, 13)[:, None]
    for _ in range(120):
        turn, reach, height = rng.uniform((0, 0.08, 0.20), (2 * np.pi, 0.62, 0.46))
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        droop = rng.uniform(0.5, 0.95)
        rise = height * (1.5 * share - droop * share**2.6)
        path = reach * share**1.5 * out + rise * np.array([0.0, 0.0, 1.0])
        half = rng.uniform(0.0005, 0.0015) * (1 - 0.8 * share**2) * np.array([1.0, 0.0, 0.3])
        start = 0.05 * out + [0, 0, RIM - 0.02]
        blades.append(_planted(_lengthwise(sheet(np.stack([path - half, path + half]) + start))))
    return blades


def _flower_heads(rng: Generator) -> list[Floats]:
    """The flower in focus first, the others around it."""
    others = (
        (-0.15, 1.44, 1.44),
        (0.17, 1.46, 1.45),
        (-0.055, 1.47, 1.505),
        (0.25, 1.50, 1.28),
        (-0.25, 1.50, 1.30),
    )
    return [HEART, *(np.array(place) + rng.uniform(-0.012, 0.012, 3) for place in others)]


def _corolla(rng: Generator, head: Floats) -> Shape:
    """A ring of petals that faces the camera, tilted a little."""
    petals = []
    for number in range(17):
        blade = leaf(rng.uniform(0.042, 0.052), 0.0125, rng.uniform(0.0, 0.008), 0.004).moved(0.012, 0, 0)
        petals.append(_lengthwise(blade).turned(360 * number / 17 + rng.uniform(-4, 4)))
    # From lying with its face up to facing -y.
    return join(petals).turned(90 + rng.uniform(-14, 8), "x").turned(rng.uniform(-18, 18)).moved(*head)


def _heart() -> Shape:
    """A flat dome towards the camera."""
    angle = np.linspace(0, np.pi / 2, 8)
    profile = np.stack([0.020 * np.cos(angle), 0.012 * np.sin(angle)], axis=1)
    return turned_body(profile, 32).turned(90, "x")


def _petal(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Orange towards the heart, pale at the tip, with veins along it."""
    y = np.linspace(0, 1, shape[0], dtype=np.float32)[:, None]
    veins = textures.noise(rng, shape, (2, shape[1] / 3), 2)
    tone = np.clip(y + 0.35 * (veins - 0.5), 0, 1).astype(np.float32)
    return textures.ramp(tone, (0.96, 0.84, 0.62), (0.92, 0.56, 0.26), (0.62, 0.14, 0.10))


def _seeds(rng: Generator, size: int) -> Picture:
    """Rows of florets, dark and yellow, in spirals as a disc is wound; the top row is the middle."""
    row, column = np.mgrid[0:size, 0 : 3 * size].astype(np.float32) / size
    one, other = (5 * row + 5 * column) % 1, (5 * row - 5 * column) % 1
    floret = np.hypot(one - 0.5, other - 0.5)
    picture = textures.ramp(
        np.clip(2 * floret, 0, 1), (0.95, 0.78, 0.22), (0.60, 0.34, 0.08), (0.16, 0.08, 0.04)
    )
    shade = 0.7 + 0.4 * textures.noise(rng, row.shape, (6, 18), 4)[..., None]
    return np.clip(picture * shade, 0, 1).astype(np.float32)
