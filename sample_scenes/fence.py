"""A toy tram that passes behind a garden fence, and a bird house in focus beside its track."""

from __future__ import annotations

import cv2
import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .slope import sheet
from .stage import FRAMES, WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 97
FOCAL = 700 / WIDTH
FENCE = 1.3
PICKET, PITCH, FIRST = (0.04, 0.016, 1.27), 0.172, -0.905
"""A picket's width, thickness and height; from one's middle to the next one's; the first one's middle."""
BED = 0.43
"""Height of the raised bed that the track runs on."""
TRAM = np.array([0.0, 3.0, BED + 0.028])
LENGTH = 0.88
"""The tram's, in metres."""
WAY = (-0.72, 0.72)
"""From where to where its middle goes: 1.6 lengths."""
HOUSE = np.array([0.06, 3.2, 1.13])
"""The middle of the foot of the bird house's front."""


def stage() -> Stage:
    """A fence at 1.3 m, the tram at 3 m, a bird house at 3.2 m, a hedge at 7 m, cabins at 9 to 10 m."""
    cameras = handheld((-0.07, 0, 1.10), (0.07, 0.01, 1.11), (0.0, 3.2, 0.95), (0.02, 3.2, 0.95), FOCAL, SEED)
    behind, green, bed, tram, fence = np.random.default_rng(SEED).spawn(5)
    travel = np.zeros((FRAMES, 3))
    travel[:, 0] = np.linspace(*WAY, FRAMES)
    things = (*far(behind), *hedge(green), *_bed(bed), *_tram(tram, travel), *_fence(fence))
    focus = HOUSE - [-0.045, 0, -0.13]
    return Stage(
        "fence", "a tram that passes behind a fence", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.52, 0.62, 0.76), sun=(-0.4, -0.65, 0.7),
    )  # fmt: skip


def lengthwise(shape: Shape) -> Shape:
    """Rods and leaves with the texture's height along them."""
    return Shape(shape.vertices, shape.faces, shape.uv[..., ::-1])


def _gabled(width: float, depth: float, height: float) -> Shape:
    """A prism that stands on z = 0, its ridge along y."""
    shape = box((width, depth, height))
    narrow = np.where(shape.vertices[:, 2:] > height / 2, [0.02, 1.0, 1.0], 1.0)
    return Shape(shape.vertices * narrow, shape.faces, shape.uv)


def bush(rng: Generator, size: tuple[float, float, float], count: int, length: float) -> Shape:
    """Leaves all over a ball of the given half axes about the origin, pointing outwards."""
    ends = rng.normal(size=(count, 3))
    ends /= np.linalg.norm(ends, axis=1, keepdims=True)
    leaves = []
    for x, y, z in ends:
        blade = lengthwise(leaf(length * rng.uniform(0.7, 1.3), 0.5 * length, 0.1 * length, 0.3 * length))
        turned = blade.turned(rng.uniform(-60, 60), "x").turned(-np.degrees(np.arcsin(z)) * 0.7, "y")
        turned = turned.turned(np.degrees(np.arctan2(y, x)))
        leaves.append(turned.moved(*(np.array([x, y, z]) * size * rng.uniform(0.8, 1.0))))
    return join(leaves)


# Painting


def cobbles(
    rng: Generator, shape: tuple[int, int], size: float, *colours: tuple[float, float, float]
) -> Picture:
    """Rounded stones, or leaves, of about `size` pixels: one of the colours each, dark gaps between them."""
    height, width = shape
    grid = np.mgrid[0 : height / size, 0 : width / size].reshape(2, -1).T
    seeds = ((grid + rng.uniform(0.1, 0.9, grid.shape)) * size).astype(int)
    seeds = seeds[(seeds < shape).all(axis=1)]
    empty = np.ones(shape, np.uint8)
    empty[tuple(seeds.T)] = 0
    far, label = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    tone = rng.random(label.max() + 1, dtype=np.float32)[label]
    seam = cv2.morphologyEx(label.astype(np.float32), cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)) > 0
    round_ = np.clip(1.15 - 0.5 * (far / (0.6 * size)) ** 2, 0.4, 1.15) * np.where(seam, 0.55, 1.0)
    grain = 0.8 + 0.4 * textures.noise(rng, shape, (height / 4, width / 4), 2)
    return np.asarray(np.clip(textures.ramp(tone, *colours) * (round_ * grain)[..., None], 0, 1), np.float32)


GREENS = ((0.10, 0.20, 0.08), (0.22, 0.36, 0.13), (0.40, 0.52, 0.20))
STONES = ((0.34, 0.31, 0.28), (0.56, 0.52, 0.46), (0.74, 0.68, 0.58))


def _cabin_front(rng: Generator, shape: tuple[int, int], paint: Floats) -> Picture:
    """Painted boards, two windows with shutters, a door."""
    height, width = shape
    picture = textures.wood(rng, (width, height), 11, paint * 0.55, np.clip(paint + 0.12, 0, 1)).swapaxes(
        0, 1
    )
    picture = np.ascontiguousarray(picture)
    for left in (0.10, 0.70):
        x0, x1, y0, y1 = int(left * width), int((left + 0.2) * width), int(0.10 * height), int(0.46 * height)
        picture[y0 - 4 : y1 + 4, x0 - 10 : x1 + 10] = (0.30, 0.36, 0.28)
        picture[y0 - 3 : y1 + 3, x0 - 3 : x1 + 3] = (0.90, 0.88, 0.82)
        picture[y0:y1, x0:x1] = (0.18, 0.24, 0.30)
        picture[y0:y1, x0 : x1 : max((x1 - x0) // 2, 1)] = (0.90, 0.88, 0.82)
    picture[int(0.3 * height) :, int(0.42 * width) : int(0.58 * width)] *= (0.55, 0.5, 0.45)
    return picture


def _livery(rng: Generator, shape: tuple[int, int]) -> Picture:
    """The tram's side: red below, cream above, windows with heads behind them, lines, name and number."""
    height, width = shape
    red, cream, gold = (0.70, 0.13, 0.11), (0.90, 0.84, 0.68), (0.88, 0.68, 0.24)
    picture = np.empty((height, width, 3), np.float32)
    picture[:] = cream
    picture[height // 2 :] = red
    for row, thick, ink in ((0.50, 3, gold), (0.58, 2, gold), (0.90, 3, gold), (0.96, 8, (0.2, 0.18, 0.18))):
        picture[int(row * height) : int(row * height) + thick] = ink
    for number in range(7):
        x0, x1 = int((number + 0.16) * width / 7), int((number + 0.84) * width / 7)
        y0, y1 = int(0.10 * height), int(0.44 * height)
        picture[y0 - 3 : y1 + 3, x0 - 3 : x1 + 3] = (0.42, 0.24, 0.12)
        picture[y0:y1, x0:x1] = textures.ramp(textures.noise(rng, (y1 - y0, x1 - x0), (4, 4), 3),
                                              (0.10, 0.14, 0.18), (0.45, 0.55, 0.62))  # fmt: skip
        head = (int(rng.uniform(x0 + 10, x1 - 10)), y1 - 12)
        coat = tuple(map(float, rng.uniform(0.2, 0.8, 3)))
        cv2.ellipse(picture, (head[0], y1), (13, 9), 0, 180, 360, coat, -1, cv2.LINE_AA)
        cv2.circle(picture, head, 6, (0.80, 0.58, 0.44), -1, cv2.LINE_AA)
    for shift in (0, 1):
        textures.write(picture, "MERIAN RING", (width * 0.36 + shift, height * 0.75), 0.95, gold)
        textures.write(picture, "417", (width * 0.80 + shift, height * 0.75), 1.0, cream)
    for x in (0.07, 0.63, 0.94):
        cv2.circle(picture, (int(x * width), int(0.75 * height)), 10, cream, 2, cv2.LINE_AA)
        cv2.circle(picture, (int(x * width), int(0.75 * height)), 4, gold, -1, cv2.LINE_AA)
    worn = 0.80 + 0.3 * textures.noise(rng, shape, (12, 30), 5)
    return np.clip(picture * worn[..., None], 0, 1)


def _bird_house_front(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Boards with painted flowers around a round hole."""
    height, width = shape
    picture = textures.wood(rng, shape, 4, (0.52, 0.66, 0.68), (0.86, 0.90, 0.84))
    picture = np.ascontiguousarray(picture)
    for number in range(16):
        x, y = int(rng.uniform(0.08, 0.92) * width), int(rng.uniform(0.05, 0.95) * height)
        ink = ((0.76, 0.20, 0.18), (0.90, 0.66, 0.18), (0.24, 0.30, 0.56))[number % 3]
        for turn in np.arange(5) * 2 * np.pi / 5:
            petal = (x + round(6 * np.cos(turn)), y + round(6 * np.sin(turn)))
            cv2.circle(picture, petal, 4, ink, -1, cv2.LINE_AA)
        cv2.circle(picture, (x, y), 3, (0.95, 0.90, 0.70), -1, cv2.LINE_AA)
    cv2.circle(
        picture, (width // 2, int(0.36 * height)), int(0.20 * width), (0.60, 0.42, 0.22), -1, cv2.LINE_AA
    )
    cv2.circle(
        picture, (width // 2, int(0.36 * height)), int(0.16 * width), (0.06, 0.05, 0.05), -1, cv2.LINE_AA
    )
    return picture


# Behind


def far(rng: Generator) -> list[Prop]:
    """The lawn, and cabins of an allotment garden."""
    lawn = cobbles(rng, (320, 320), 4, *GREENS)
    tiles = cobbles(rng, (96, 160), 7, (0.40, 0.16, 0.10), (0.62, 0.30, 0.20), (0.74, 0.44, 0.30))
    props = [Prop("lawn", box((30, 30, 0.02)).moved(0, 9, -0.02), lawn)]
    paints = np.array([(0.34, 0.50, 0.40), (0.36, 0.50, 0.66), (0.80, 0.66, 0.36), (0.66, 0.34, 0.26)])
    for number, (x, y, wide) in enumerate(
        ((-4.6, 9.8, 2.6), (-1.35, 9.4, 2.4), (1.75, 9.9, 2.5), (5.0, 9.5, 2.8))
    ):
        front = box((wide, 2.0, 2.05)).moved(x, y + 1.0, 0)
        roof = _gabled(wide + 0.5, 2.4, 1.1).moved(x, y + 1.0, 2.05)
        props.append(Prop(f"cabin {number}", front, _cabin_front(rng, (160, 208), paints[number])))
        props.append(Prop(f"roof {number}", roof, tiles))
    return props


def hedge(rng: Generator) -> list[Prop]:
    """A clipped hedge with bumps, a small tree above it, roses before it."""
    rows, columns = 14, 80
    x = np.broadcast_to(np.linspace(-5.5, 5.5, columns), (rows, columns))
    turn = np.linspace(0, 1, rows)[:, None]
    bumps = textures.noise(rng, (rows, columns), (4, 26), 3) - 0.5
    y = 7.0 + 0.22 * bumps + np.where(turn > 0.7, (turn - 0.7) * 2.2, 0.0)
    z = np.minimum(turn / 0.7, 1.0) * 1.32 + np.where(turn > 0.6, 0.18, 0.0) * bumps
    front = sheet(np.stack([x, y, z], axis=-1))
    sprigs = [
        bush(rng, (0.16, 0.10, 0.10), 14, 0.14).moved(a, 7.15, rng.uniform(1.22, 1.36))
        for a in np.linspace(-5, 5, 34)
    ]
    crown = bush(rng, (1.0, 0.6, 0.8), 420, 0.26).moved(-2.75, 8.0, 2.5)
    trunk = lengthwise(tube(np.linspace((-2.75, 8.0, 0.5), (-2.7, 8.0, 2.4), 8), 0.07, 12))
    shrub = bush(rng, (0.75, 0.5, 0.55), 280, 0.2).moved(3.1, 7.6, 1.75)
    roses = [
        sphere(0.055, 12).moved(*place) for place in rng.uniform((-4, 6.7, 0.35), (4, 6.8, 1.2), (46, 3))
    ]
    bloom = textures.speckled(rng, (48, 96), (0.62, 0.10, 0.16), (0.96, 0.62, 0.62))
    green = textures.foliage(rng, (96, 48))
    return [
        Prop("hedge", front, cobbles(rng, (192, 640), 6, *GREENS), smooth=True, layer=1),
        Prop("sprigs", join(sprigs), green, layer=1),
        Prop("tree", join([crown, shrub]), green[:, ::-1], layer=1),
        Prop(
            "trunk", trunk, textures.wood(rng, (128, 64), 3, (0.22, 0.15, 0.10), (0.46, 0.36, 0.26)), layer=1
        ),
        Prop("roses", join(roses), bloom, smooth=True, layer=1),
    ]


# In focus


def _bed(rng: Generator) -> list[Prop]:
    """A raised bed of stones with the track, a bird house on its pole, a gnome, flowers."""
    stones = cobbles(rng, (96, 640), 22, *STONES)
    gravel = cobbles(rng, (112, 704), 5, *STONES)
    sleepers = [box((0.035, 0.24, 0.012)).moved(x, TRAM[1], BED) for x in np.arange(-2.4, 2.41, 0.11)]
    path = np.linspace((-2.5, 0, 0), (2.5, 0, 0), 12)
    rails = [lengthwise(tube(path, 0.008, 6)).moved(0, TRAM[1] + side, BED + 0.018) for side in (-0.08, 0.08)]
    steel = textures.speckled(rng, (640, 8), (0.22, 0.20, 0.19), (0.70, 0.66, 0.62))
    timber = textures.wood(rng, (64, 64), 3, (0.20, 0.13, 0.09), (0.50, 0.36, 0.24))
    flowers = [
        bush(rng, (0.09, 0.05, 0.07), 34, 0.05).moved(x, 3.27, BED + rng.uniform(0.03, 0.10))
        for x in (-1.55, -1.2, -0.66, -0.42, -0.2, 0.32, 0.55, 0.8, 1.35, 1.6)
    ]
    blossoms = [
        sphere(0.014, 10).moved(rng.uniform(-1.6, 1.6), rng.uniform(3.2, 3.26), BED + rng.uniform(0.06, 0.2))
        for _ in range(70)
    ]
    petals = textures.speckled(rng, (32, 64), (0.86, 0.50, 0.16), (0.98, 0.90, 0.62))
    return [
        Prop("bed", box((6.4, 0.62, BED)).moved(0, 3.03, 0), stones, layer=2),
        Prop("gravel", box((6.4, 0.60, 0.004)).moved(0, 3.03, BED), gravel, layer=2),
        Prop("sleepers", join(sleepers), timber, layer=2),
        Prop("rails", join(rails), steel, smooth=True, layer=2),
        Prop("flowers", join(flowers), textures.foliage(rng, (64, 32)), layer=2),
        Prop("blossoms", join(blossoms), petals, smooth=True, layer=2),
        *_bird_house(rng),
        *_gnome(rng),
    ]


def _bird_house(rng: Generator) -> list[Prop]:
    x, y, z = HOUSE
    boards = textures.wood(rng, (128, 96), 4, (0.36, 0.22, 0.13), (0.66, 0.46, 0.30))
    shingles = cobbles(rng, (96, 128), 9, (0.42, 0.16, 0.12), (0.66, 0.30, 0.20), (0.76, 0.50, 0.34))
    pole = lengthwise(tube(np.linspace((x, y + 0.11, BED), (x, y + 0.11, z), 8), 0.02, 12))
    perch = tube(np.linspace((0, 0, 0), (0, -0.07, 0), 4), 0.006, 8, up=(0, 0, 1)).moved(x, y, z + 0.085)
    # Two slabs of roof lean against each other over the front's upper corners.
    slabs = [
        box((0.21, 0.27, 0.018)).moved(0, 0, 0).turned(side * 38, "y").moved(side * 0.075, 0, 0)
        for side in (-1, 1)
    ]
    roof = join(slabs).moved(x, y + 0.10, z + 0.255)
    return [
        Prop("bird house", box((0.24, 0.20, 0.22)).moved(x, y + 0.102, z), boards, layer=2),
        Prop(
            "front",
            box((0.24, 0.004, 0.22)).moved(x, y + 0.002, z),
            _bird_house_front(rng, (176, 192)),
            layer=2,
        ),
        Prop("gable", _gabled(0.24, 0.20, 0.085).moved(x, y + 0.10, z + 0.22), boards, layer=2),
        Prop("bird house roof", roof, shingles, layer=2),
        Prop("pole and perch", join([pole, perch]), boards[:, ::-1], smooth=True, layer=2),
    ]


def _gnome(rng: Generator) -> list[Prop]:
    """A gnome behind the track, whom the tram hides for a while."""
    coat = [(0.0, 0.0), (0.10, 0.0), (0.11, 0.04), (0.10, 0.16), (0.06, 0.24), (0.0, 0.25)]
    hat = [(0.085, 0.30), (0.08, 0.32), (0.05, 0.42), (0.02, 0.50), (0.0, 0.53)]
    x, y = -0.62, 3.24
    face = textures.speckled(rng, (48, 96), (0.78, 0.52, 0.40), (0.92, 0.70, 0.58))
    felt = textures.cloth(rng, (96, 128), (0.66, 0.12, 0.10), (0.88, 0.60, 0.30))
    beard = lengthwise(leaf(0.14, 0.13, 0.0, 0.0)).turned(90, "y").turned(90).moved(0, -0.09, 0.27)
    white = textures.ramp(textures.noise(rng, (64, 48), (4, 24), 3), (0.58, 0.56, 0.52), (0.95, 0.93, 0.88))
    return [
        Prop(
            "gnome's coat",
            turned_body(coat, 32).moved(x, y, BED),
            textures.mug(rng, 88),
            smooth=True,
            layer=2,
        ),
        Prop("gnome's head", sphere(0.075, 24).moved(x, y, BED + 0.28), face, smooth=True, layer=2),
        Prop("gnome's hat", turned_body(hat, 32).moved(x, y, BED), felt, smooth=True, layer=2),
        Prop("gnome's beard", beard.moved(x, y, BED), white, layer=2),
    ]


# The mover


def _tram(rng: Generator, travel: Floats) -> list[Prop]:
    """A toy tram as long as a forearm and a half, all of one piece."""
    wheels = []
    for along in (-0.30, -0.16, 0.16, 0.30):
        # A wheel is a low drum on its side; rings only, which look the same however it has rolled.
        drum = turned_body([(0.045, 0.0), (0.048, 0.02), (0.03, 0.024), (0.012, 0.02), (0.0, 0.024)], 28)
        wheels.append(drum.turned(90, "x").moved(along, -0.075, 0.045))
    tread = textures.ramp(np.tile(np.linspace(0, 4, 64, dtype=np.float32)[:, None] % 1, (1, 64)),
                          (0.12, 0.11, 0.11), (0.62, 0.58, 0.54))  # fmt: skip
    tread = tread * (0.6 + 0.4 * textures.noise(rng, (64, 64), (20, 20), 2)[..., None])
    body = box((LENGTH, 0.23, 0.31)).moved(0, 0, 0.075)
    roof = join(
        [
            box((LENGTH + 0.02, 0.25, 0.03)).moved(0, 0, 0.385),
            box((LENGTH * 0.8, 0.13, 0.035)).moved(0, 0, 0.415),
        ]
    )
    skirt = join([box((0.24, 0.02, 0.05)).moved(side, -0.10, 0.045) for side in (-0.23, 0.23)])
    bow = np.array([(-0.10, 0, 0.45), (0.0, 0, 0.50), (-0.08, 0, 0.565), (0.0, 0, 0.60)])
    arms = [lengthwise(tube(np.linspace(bow[n], bow[n + 1], 4), 0.005, 8)) for n in range(3)]
    arms.append(tube(np.linspace((0.0, -0.09, 0.60), (0.0, 0.09, 0.60), 4), 0.006, 8, up=(0, 0, 1)))
    slate = cobbles(rng, (48, 256), 6, (0.22, 0.24, 0.26), (0.46, 0.48, 0.50))
    parts = (
        ("tram", body, _livery(rng, (150, 416)), False),
        ("tram's roof", roof, slate, False),
        ("tram's skirts", skirt, slate[:, 64:128] * np.float32(0.6), False),
        ("tram's wheels", join(wheels), tread, True),
        ("pantograph", join(arms), tread[::-1], True),
    )
    return [
        Prop(name, shape.moved(*TRAM), np.asarray(picture, np.float32), smooth, layer=3, travel=travel)
        for name, shape, picture, smooth in parts
    ]


# Before everything


def _fence(rng: Generator) -> list[Prop]:
    """Pickets with pointed tops on a rail, and a vine on two of them."""
    width, thick, height = PICKET
    weathered = textures.wood(rng, (640, 192), 12, (0.42, 0.38, 0.34), (0.90, 0.87, 0.80))
    pickets = []
    for number in range(12):
        rect = (number / 12, 0.0, (number + 1) / 12, 1.0)
        tip = _gabled(width, thick, 0.045).moved(0, 0, height)
        tip = Shape(tip.vertices, tip.faces, np.array(rect[:2]) + tip.uv * [1 / 12, 0.06])
        slat = join([box((width, thick, height), rect), tip])
        lean = rng.uniform(-0.6, 0.6)
        pickets.append(slat.turned(lean, "y").moved(FIRST + PITCH * number, FENCE, rng.uniform(-0.02, 0.02)))
    rail = box((2.6, 0.02, 0.042)).moved(0, FENCE + 0.02, 0.74)
    height_along = np.linspace(0.6, 1.3, 30)
    vines, leaves = [], []
    for number in (2, 8):
        x = FIRST + PITCH * number
        around = 11 * height_along
        stem = [x + 0.026 * np.sin(around), FENCE - 0.016 - 0.004 * np.cos(around), height_along]
        coil = np.stack(stem, axis=1)
        vines.append(lengthwise(tube(coil, 0.003, 6)))
        for foot in coil[::2]:
            blade = lengthwise(leaf(rng.uniform(0.03, 0.05), 0.026, 0.008, 0.02)).turned(
                rng.uniform(40, 80), "x"
            )
            leaves.append(
                blade.turned(rng.choice([0, 180]) + rng.uniform(-40, 40)).moved(*foot - [0, 0.006, 0])
            )
    return [
        Prop("pickets", join(pickets), weathered, layer=4),
        Prop("rail", rail, np.ascontiguousarray(weathered[:, :64].swapaxes(0, 1)), layer=4),
        Prop(
            "vines",
            join(vines),
            textures.speckled(rng, (256, 8), (0.2, 0.14, 0.08), (0.4, 0.4, 0.2)),
            layer=4,
        ),
        Prop("vine leaves", join(leaves), textures.foliage(rng, (96, 48)), smooth=True, layer=4),
    ]
