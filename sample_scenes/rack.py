"""Three subjects one behind the other, and the focus that passes from the near one to the far one.

The focus rests on the near subject, glides over the middle one, where it hardly stops, and rests on the far
one. In between it goes through the air: the point in focus is on no surface then. It goes straight from one
subject to the next, evenly in inverse depth but for a smooth start and stop.
"""

from __future__ import annotations

import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .slope import poster
from .stage import FRAMES, WIDTH, Cameras, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 89
FOCAL = 700 / WIDTH
POT = np.array([-0.19, 1.2, 0.975])
"""The near subject: the middle of its foot, as of the others."""
CLOCK = np.array([0.05, 2.5, 0.80])
GLOBE = np.array([1.06, 6.0, 1.14])
"""The far subject: its middle."""
GLOBE_RADIUS = 0.46
LEAVES, PASSES, ARRIVES = 9, 17, 27
"""Counted from 0: when the focus leaves the near subject, is on the middle one, and arrives."""
WALL = 7.5


def stage() -> Stage:
    """A coffee pot at 1.2 m, a mantel clock at 2.5 m, a globe at 6 m, a library's wall at 7.2 to 7.5 m."""
    cameras = handheld(
        (-0.07, 0, 1.23), (0.07, 0.02, 1.21), (0.02, 2.5, 1.10), (0.05, 2.5, 1.10), FOCAL, SEED
    )
    room, shelves, far, middle, near = np.random.default_rng(SEED).spawn(5)
    things = (*_room(room), *_shelves(shelves), *_globe(far), *_clock(middle), *_pot(near))
    subjects = np.stack(
        [POT - [0, 0.088, -0.10], CLOCK - [-0.03, 0.083, -0.23], GLOBE - [0, GLOBE_RADIUS, 0]]
    )
    return Stage(
        "rack", "focus that is pulled from a near subject over a middle one to a far one", cameras, things,
        focus=_pulled(cameras, subjects), air=(0.1, 0.1, 0.1),
    )  # fmt: skip


def _pulled(cameras: Cameras, subjects: Floats) -> Floats:
    """(N, 3) the point in focus: from the first of the subjects (3, 3) over the second to the third."""
    frame = np.arange(FRAMES, dtype=np.float64)
    shares = []
    for start, stop in ((LEAVES, PASSES), (PASSES, ARRIVES)):
        share = np.clip((frame - start) / (stop - start), 0, 1)
        shares.append(share**2 * (3 - 2 * share))
    # (x/z, y/z, 1/z) of one camera: straight lines of the world stay straight, and depth becomes inverse.
    rotation, translation = cameras.rotation[FRAMES // 2], cameras.translation[FRAMES // 2]
    seen = subjects @ rotation.T + translation
    inverse = np.column_stack([seen[:, :2], np.ones(3)]) / seen[:, 2:]
    path = inverse[0] + np.stack(shares, axis=1) @ np.diff(inverse, axis=0)
    back = np.column_stack([path[:, :2], np.ones(FRAMES)]) / path[:, 2:]
    return np.asarray((back - translation) @ rotation, dtype=np.float64)


def _lengthwise(shape: Shape) -> Shape:
    """Rods and leaves with the texture's height along them."""
    return Shape(shape.vertices, shape.faces, shape.uv[..., ::-1])


def _disc(radius: float) -> Shape:
    """A round plate about the origin that faces -y, with the texture's middle part on it."""
    angle = np.linspace(0, 2 * np.pi, 49)
    rim = radius * np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    vertices = np.concatenate([rim, 0.001 * rim])
    first = np.arange(48)
    faces = np.stack([first + 49, first, first + 1, first + 50], axis=1).astype(np.int32)
    return Shape(vertices, faces, (0.5 + 0.5 * vertices[:, [0, 2]] / radius)[faces])


# Far


def _room(rng: Generator) -> list[Prop]:
    boards = textures.wood(rng, (320, 256), 14, (0.28, 0.17, 0.10), (0.56, 0.38, 0.23))
    rug = textures.cloth(rng, (160, 320), (0.22, 0.30, 0.42), (0.82, 0.74, 0.58))
    props = [
        Prop("floor", box((11.0, 9.0, 0.02)).moved(0, 4.0, -0.02), boards),
        Prop("rug", box((4.2, 2.2, 0.01)).turned(5).moved(0.2, 5.4, 0), rug),
        Prop("wall", box((11.0, 0.1, 3.8)).moved(0, WALL + 0.05, 0), _damask(rng, 512)),
    ]
    plan = ((-3.35, 1.95, 0.9, 0.7), (-2.15, 1.75, 0.8, 1.1), (-1.15, 2.05, 0.7, 0.55),
            (-1.12, 1.25, 0.62, 0.7), (-3.3, 1.02, 0.8, 0.8))  # fmt: skip
    gilt = textures.speckled(rng, (64, 64), (0.34, 0.24, 0.10), (0.80, 0.62, 0.32))
    for number, (x, z, wide, tall) in enumerate(plan):
        shape = (round(150 * tall), round(150 * wide))
        paint = poster(rng, shape) if tall > wide else textures.landscape(rng, shape)
        frame = box((wide + 0.1, 0.03, tall + 0.1)).moved(x, WALL - 0.02, z - tall / 2 - 0.05)
        props.append(Prop(f"frame {number}", frame, gilt))
        props.append(
            Prop(f"picture {number}", box((wide, 0.01, tall)).moved(x, WALL - 0.04, z - tall / 2), paint)
        )
    return props


def _damask(rng: Generator, size: int) -> Picture:
    """Striped paper with rosettes, faded."""
    y, x = np.mgrid[0:size, 0:size].astype(np.float32) / size
    stripe = (x * 40) % 1 < 0.5
    u, v = (x * 20) % 1 - 0.25, (y * 9 + 0.5 * (np.floor(x * 20) % 2)) % 1 - 0.5
    rosette = np.hypot(2 * u, v) < 0.16 + 0.12 * np.cos(6 * np.arctan2(2 * u, v))
    paper = textures.ramp(
        textures.noise(rng, (size, size), (7, 7), 7), (0.44, 0.20, 0.18), (0.62, 0.32, 0.26)
    )
    paper = textures.mix(paper, (0.70, 0.46, 0.34), 0.5 * stripe)
    return textures.mix(paper, (0.86, 0.70, 0.42), 0.8 * rosette)


def _shelves(rng: Generator) -> list[Prop]:
    """Two bookcases at the right, a string of small lamps before them, and a tall plant at the left."""
    stained = textures.wood(rng, (160, 160), 5, (0.20, 0.12, 0.07), (0.46, 0.30, 0.18))
    spines, wide, step, boards = 24, 2.0, 0.37, 8
    cases, books = [], []
    for left in (0.55, 2.65):
        cases += [box((wide, 0.3, 0.035)).moved(left, 0, 0.08 + step * number) for number in range(boards)]
        cases += [box((0.05, 0.3, 0.12 + step * 7)).moved(left + side * wide / 2, 0, 0) for side in (-1, 1)]
        cases.append(box((wide, 0.02, 0.1 + step * 7)).moved(left, 0.14, 0))
        for shelf in range(boards):
            x = left - wide / 2 + 0.03
            while (thick := rng.uniform(0.03, 0.08)) and x + thick < left + wide / 2 - 0.03:
                pick, tall = rng.integers(spines), rng.uniform(0.20, 0.32)
                book = box((thick, 0.2, tall), (pick / spines, 0, (pick + 1) / spines, 1), 0.08)
                books.append(
                    book.moved(x + thick / 2, WALL - 0.2 + rng.uniform(-0.03, 0.02), 0.115 + step * shelf)
                )
                x += thick + (0.12 if rng.random() < 0.08 else 0.003)
    plant = []
    for number in range(40):
        size = rng.uniform((0.35, 0.07, 0.3, 0.1), (0.7, 0.13, 0.9, 0.5))
        plant.append(_lengthwise(leaf(*size)).turned(137.5 * number).moved(-2.75, 6.7, rng.uniform(0.5, 1.1)))
    pot = turned_body([(0.0, 0.0), (0.2, 0.0), (0.27, 0.5), (0.30, 0.5), (0.30, 0.56), (0.0, 0.5)], 32)
    return [
        Prop("bookcases", join(cases).moved(0, WALL - 0.17, 0), stained),
        Prop("books", join(books), textures.book_spines(rng, spines, (208, 36))),
        Prop("plant", join(plant), textures.foliage(rng, (160, 64)), smooth=True, layer=1),
        Prop("plant pot", pot.moved(-2.75, 6.7, 0), textures.mug(rng, 72), smooth=True, layer=1),
        *_lamps(rng),
    ]


def _lamps(rng: Generator) -> list[Prop]:
    x = np.linspace(-2.2, 3.0, 14)
    z = 2.36 - 0.2 * np.abs(np.sin(np.pi * np.arange(14) / 4)) + rng.uniform(-0.03, 0.03, 14)
    bulbs = [sphere(0.026, 12).moved(a, 6.8, b) for a, b in zip(x, z, strict=True)]
    warm = np.broadcast_to(np.array((1.0, 0.82, 0.55), np.float32), (4, 4, 3))
    cord = tube(np.stack([x, np.full(14, 6.81), z + 0.03], axis=1), 0.006, 6)
    black = textures.speckled(rng, (32, 32), (0.05, 0.05, 0.05), (0.16, 0.15, 0.14))
    return [
        Prop("lamps", join(bulbs), warm, smooth=True, glow=6.0, layer=1),
        Prop("cord", cord, black, layer=1),
    ]


def _globe(rng: Generator) -> list[Prop]:
    """A library globe on a turned foot."""
    brass = textures.speckled(rng, (48, 48), (0.46, 0.33, 0.14), (0.84, 0.66, 0.34))
    angles = np.radians(np.linspace(-110, 110, 48))
    arc = (GLOBE_RADIUS + 0.03) * np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], axis=1)
    foot = [(0.0, 0.0), (0.34, 0.0), (0.34, 0.05), (0.22, 0.10), (0.07, 0.16), (0.06, 0.30), (0.11, 0.36)]
    foot += [(0.06, 0.42), (0.05, 0.60), (0.09, 0.64), (0.0, 0.66)]
    turned = textures.wood(rng, (160, 256), 8, (0.24, 0.12, 0.06), (0.58, 0.34, 0.18))
    ball = sphere(GLOBE_RADIUS).turned(-70).turned(18, "y").moved(*GLOBE)
    return [
        Prop("globe", ball, textures.globe(rng, 320), smooth=True, layer=2),
        Prop("meridian", tube(arc, 0.02).turned(-40, "y").moved(*GLOBE), brass, smooth=True, layer=2),
        Prop("foot", turned_body(foot).moved(GLOBE[0], GLOBE[1], 0), turned, smooth=True, layer=2),
    ]


# Middle and near


def _clock(rng: Generator) -> list[Prop]:
    """A mantel clock with pillars and a pointed top, on a cabinet."""
    case = [
        box((0.40, 0.20, 0.04)), box((0.26, 0.15, 0.32)).moved(0, 0, 0.04),
        box((0.38, 0.19, 0.03)).moved(0, 0, 0.36),
        *[box((0.32 - 0.07 * n, 0.16 - 0.03 * n, 0.025)).moved(0, 0, 0.39 + 0.025 * n) for n in range(3)],
    ]  # fmt: skip
    pillar = [(0.0, 0.0), (0.022, 0.0), (0.022, 0.02), (0.015, 0.03), (0.017, 0.15), (0.014, 0.29)]
    pillar += [(0.022, 0.30), (0.022, 0.32), (0.0, 0.32)]
    knob = [(0.0, 0.0), (0.02, 0.0), (0.012, 0.015), (0.024, 0.035), (0.016, 0.055), (0.0, 0.07)]
    brasses = [turned_body(pillar, 20).moved(side, -0.07, 0.04) for side in (-0.165, 0.165)]
    brasses += [turned_body(knob, 20).moved(0, 0, 0.465)]
    marquetry = textures.cloth(rng, (200, 160), (0.30, 0.14, 0.07), (0.72, 0.48, 0.24))
    brass = textures.mug(rng, 80) * np.array((1.0, 0.84, 0.5), np.float32)
    cabinet = textures.wood(rng, (224, 256), 5, (0.26, 0.15, 0.08), (0.58, 0.38, 0.22))
    runner = textures.cloth(rng, (96, 256), (0.20, 0.34, 0.30), (0.86, 0.78, 0.62))
    x, y, z = CLOCK
    return [
        Prop("cabinet", box((0.92, 0.5, z - 0.003)).moved(x, y, 0), cabinet, layer=3),
        Prop("cabinet runner", box((0.7, 0.52, 0.003)).moved(x, y, z - 0.003), runner, layer=3),
        Prop("clock", join(case).moved(x, y, z), marquetry, layer=3),
        Prop("pillars", join(brasses).moved(x, y, z), brass, smooth=True, layer=3),
        Prop("dial", _disc(0.112).moved(x, y - 0.083, z + 0.20), textures.clock_face(rng, 224), layer=3),
    ]


def _pot(rng: Generator) -> list[Prop]:
    """An enamel coffee pot on a pile of books on a stool."""
    belly = [
        (0.0, 0.0),
        (0.082, 0.0),
        (0.09, 0.01),
        (0.088, 0.10),
        (0.066, 0.17),
        (0.054, 0.195),
        (0.058, 0.20),
    ]
    lid = [
        (0.058, 0.0),
        (0.046, 0.018),
        (0.012, 0.028),
        (0.009, 0.034),
        (0.014, 0.044),
        (0.008, 0.055),
        (0.0, 0.056),
    ]
    share = np.linspace(0, 1, 14)[:, None]
    spout = np.array([0.07, 0, 0.07]) + np.hstack([0.085 * share, 0 * share, 0.04 * share + 0.075 * share**2])
    angle = np.radians(np.linspace(80, 280, 24))
    grip = np.stack([-0.066 + 0.055 * np.cos(angle), 0 * angle, 0.105 + 0.065 * np.sin(angle)], axis=1)
    enamel = textures.mug(rng, 208)
    plain = textures.mug(rng, 96)[:, ::-1] * np.array((0.55, 0.75, 0.95), np.float32)
    rods = join([_lengthwise(tube(spout, 0.013, 14)), _lengthwise(tube(grip, 0.009, 12))])
    body = join([turned_body(belly, 56), turned_body(lid, 40).moved(0, 0, 0.20)])
    spines, books, top = 6, [], POT[2]
    for number, thick in enumerate((0.036, 0.05, 0.042)):
        top -= thick
        book = box((thick, 0.22, 0.34), (number / spines, 0, (number + 1) / spines, 1), 0.08).moved(
            0, 0, -0.17
        )
        lying = book.turned(-90, "y").turned(rng.uniform(-7, 7))
        books.append(lying.moved(POT[0], POT[1], top + thick / 2))
    seat = textures.wood(rng, (128, 192), 4, (0.40, 0.25, 0.13), (0.74, 0.52, 0.31))
    return [
        Prop("stool", box((0.44, 0.28, 0.04)).moved(POT[0], POT[1], top - 0.04), seat, layer=4),
        Prop("pile of books", join(books), textures.book_spines(rng, spines, (384, 56)), layer=4),
        Prop("coffee pot", body.moved(*POT), enamel, smooth=True, layer=4),
        Prop("spout and handle", rods.moved(*POT), plain, smooth=True, layer=4),
    ]
