"""A walk straight into a laboratory: the thesis's first video.

Near: a desk at the left and a plant at the right, passed on the way. The subject: a gray chair at 3 m, 2.1 m
in the end. Behind it desks, monitors and shelves on both sides, and a white poster on the back wall at 8.6 m.
The motion is along the gaze, which leaves a reconstruction's focal length open, and uncovers little.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, turned_body
from .stage import FRAMES, WIDTH, Floats, Prop, Stage, handheld
from .textures import Generator, Picture

SEED = 83
FOCAL = 480 / WIDTH
EYE = 1.5
STEPS = 0.9
"""How far the camera walks, in metres."""
CHAIR = (0.22, 3.0, 24.0)
"""x and y of the backrest's middle, and the turn of the chair in degrees."""
BACK, SIDE, CEILING = 8.6, 2.7, 2.8
INDOORS = np.zeros((FRAMES, 3))
"""The travel of things that stand still but throw no shadow: the sun comes in through walls and ceiling."""


def stage() -> Stage:
    """Desk and plant at 1.6 to 2.6 m, a chair at 3 m, desks at 4.5 to 6.5 m, shelves and wall to 8.6 m."""
    ahead = (0.1, BACK, 1.02)
    cameras = handheld((0.1, 0, EYE), (0.1, STEPS, EYE), ahead, ahead, FOCAL, SEED, shake=0.006)
    room, walls, far, middle, subject, near = np.random.default_rng(SEED).spawn(6)
    chair, focus = _gray_chair(subject)
    things = (*_room(room), *_on_walls(walls), *_far(far), *_middle(middle), *chair, *_near(near))
    return Stage(
        "walk", "straight ahead through a laboratory", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.3, 0.3, 0.3), sun=(-0.4, -0.7, 0.6),
    )  # fmt: skip


# Surfaces


def _carpet(rng: Generator, shape: tuple[int, int], tiles: tuple[int, int]) -> Picture:
    """Tiles in two tones, flecked, with worn joints and spots."""
    height, width = shape
    row, column = np.arange(height)[:, None] * tiles[0] / height, np.arange(width)[None] * tiles[1] / width
    odd = (np.floor(row) + np.floor(column)) % 2 == 1
    picture = textures.ramp(textures.noise(rng, shape, (7, 5), 6), (0.24, 0.27, 0.33), (0.40, 0.42, 0.47))
    picture = textures.mix(picture, (0.50, 0.46, 0.40), 0.45 * odd)
    for colour in ((0.70, 0.62, 0.46), (0.14, 0.14, 0.18)):
        fleck = textures.noise(rng, shape, (height / 5, width / 5), 1) > 0.84
        picture = textures.mix(picture, colour, 0.7 * fleck)
    joint = (row % 1 < tiles[0] / height) | (column % 1 < tiles[1] / width)
    return textures.mix(picture, (0.12, 0.12, 0.14), 0.8 * joint)


def bricks(
    rng: Generator, shape: tuple[int, int], courses: int, across: int, light: Sequence[float]
) -> Picture:
    """Painted brickwork: every brick a tone of its own, joints, flaked spots."""
    height, width = shape
    course = np.arange(height)[:, None] * courses / height
    place = np.arange(width)[None] * across / width + 0.5 * (np.floor(course) % 2)
    tone = rng.uniform(0.80, 1.0, (courses, across + 1))[course.astype(int), place.astype(int)]
    picture = (
        textures.ramp(textures.noise(rng, shape, (6, 6), 7), np.array(light) * 0.78, light) * tone[..., None]
    )
    joint = (course % 1 < 1.6 * courses / height) | (place % 1 < 1.6 * across / width)
    picture = textures.mix(picture.astype(np.float32), np.array(light) * 0.55, 0.8 * joint)
    flaked = textures.noise(rng, shape, (height / 5, width / 5), 2) > 0.94
    return textures.mix(picture, np.array(light) * (0.55, 0.42, 0.36), 0.7 * flaked)


def poster(rng: Generator, shape: tuple[int, int], paper: Sequence[float], ink: Sequence[float]) -> Picture:
    """A conference poster: title, columns of text, figures and a chart."""
    height, width = shape
    picture = np.ascontiguousarray(
        textures.ramp(textures.noise(rng, shape, (4, 4), 5), np.array(paper) * 0.95, paper)
    )
    edge = max(2, width // 50)
    cv2.rectangle(picture, (edge, edge), (width - edge, height - edge), tuple(ink), max(1, edge // 2))
    title = f"{textures.word(rng, 2).title()} {textures.word(rng)}"
    size = 0.8 * width / cv2.getTextSize(title, textures.FONT, 1.0, 1)[0][0]
    for shift in (-1, 0, 1):
        textures.write(picture, title, (width / 2 + shift, 0.10 * height), size, ink)
    for row in np.arange(0.2, 0.95, 14 / height):
        for left in (0.27, 0.73):
            line = " ".join(textures.word(rng, 2) for _ in range(2))
            textures.write(picture, line, (left * width, row * height), 0.0022 * width, ink)
    for top, left in ((0.24, 0.07), (0.60, 0.54)):
        high, wide = round(0.24 * height), round(0.39 * width)
        y, x = round(top * height), round(left * width)
        picture[y : y + high, x : x + wide] = textures.landscape(rng, (high, wide))
    bars = rng.uniform(0.05, 0.20, 6)
    for number, tall in enumerate(bars):
        x, y = round((0.09 + 0.06 * number) * width), round(0.90 * height)
        colour = tuple(map(float, rng.uniform(0.1, 0.8, 3)))
        cv2.rectangle(picture, (x, y - round(tall * height)), (x + round(0.045 * width), y), colour, -1)
    return picture


def _whiteboard(rng: Generator, shape: tuple[int, int]) -> Picture:
    """Curves, boxes and arrows, words, and what was not wiped off."""
    height, width = shape
    picture = textures.ramp(textures.noise(rng, shape, (5, 7), 5), (0.70, 0.72, 0.74), (0.86, 0.87, 0.86))
    picture = np.ascontiguousarray(picture)
    pens = ((0.10, 0.16, 0.50), (0.66, 0.10, 0.10), (0.08, 0.40, 0.16), (0.10, 0.10, 0.12))
    for number in range(14):
        centre = rng.uniform((0.1 * width, 0.12 * height), (0.9 * width, 0.88 * height))
        pen, half = pens[number % 4], rng.uniform((10, 8), (28, 18))
        low, high = (centre - half).astype(int).tolist(), (centre + half).astype(int).tolist()
        cv2.rectangle(picture, low, high, pen, 1)
        cv2.line(
            picture, high, rng.uniform((0, 0), (width, height)).astype(int).tolist(), pen, 1, cv2.LINE_AA
        )
        textures.write(picture, textures.word(rng, 2), tuple(centre), 0.4, pen)
    picture[:4], picture[-4:], picture[:, :4], picture[:, -4:] = [np.float32(0.35)] * 4
    return picture


def _screen(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A program's text in colours, a window over it, a black bezel."""
    height, width = shape
    picture = textures.ramp(textures.noise(rng, shape, (4, 6), 4), (0.08, 0.10, 0.16), (0.16, 0.18, 0.26))
    picture = np.ascontiguousarray(picture)
    for row in range(12, height - 10, 7):
        left, colour = 10 + 8 * int(rng.integers(4)), rng.uniform(0.4, 0.95, 3)
        while left < 0.9 * width - 20 and rng.random() < 0.85:
            wide = int(rng.integers(5, 26))
            picture[row : row + 4, left : left + wide] = colour
            left += wide + 4
    y, x = round(0.3 * height), round(rng.uniform(0.35, 0.5) * width)
    window = textures.landscape(rng, (round(0.5 * height), round(0.42 * width)))
    picture[y : y + window.shape[0], x : x + window.shape[1]] = window
    picture[y - 6 : y, x : x + window.shape[1]] = (0.80, 0.80, 0.84)
    picture[:5], picture[-5:], picture[:, :5], picture[:, -5:] = [np.float32(0.05)] * 4
    return picture


def _fabric(rng: Generator, shape: tuple[int, int], colour: Sequence[float]) -> Picture:
    """Upholstery: a coarse weave with light and dark knots, seams along it."""
    height, width = shape
    row, column = np.mgrid[0:height, 0:width]
    worn = textures.ramp(
        textures.noise(rng, shape, (5, 5), 6), np.array(colour) * 0.7, np.array(colour) * 1.2
    )
    weave = 0.84 + 0.32 * ((row // 3 + column // 3) % 2)
    picture = (worn * weave[..., None]).astype(np.float32)
    for tone in (0.2, 0.92):
        knot = textures.noise(rng, shape, (height / 5, width / 5), 1) > 0.90
        picture = textures.mix(picture, (tone, tone, tone * 0.98), 0.6 * knot)
    seam = (np.abs(row - 0.3 * height) < 1.5) | (np.abs(np.abs(column - width / 2) - 0.34 * width) < 1.5)
    return np.clip(textures.mix(picture, (0.08, 0.08, 0.09), 0.8 * seam), 0, 1)


# Furniture


def _cushion(size: tuple[float, float, float], segments: int = 48) -> Shape:
    """An upholstered block about the origin, its edges round, the texture laid over its widest two axes."""
    ball = sphere(1.0, segments)
    unit = np.sign(ball.vertices) * np.abs(ball.vertices) ** 0.42
    across, up = sorted(np.argsort(size)[1:])
    uv = 0.5 + 0.5 * unit[:, [across, up]]
    return Shape(unit * size / 2, ball.faces, uv[ball.faces])


def _swivel_chair(height: float = 1.16) -> tuple[Shape, Shape]:
    """Upholstery and frame of an office chair seen from behind, its backrest over the origin."""
    back = _cushion((0.50, 0.09, 0.62)).moved(0, 0, height - 0.31)
    seat = _cushion((0.52, 0.50, 0.10)).moved(0, 0.27, 0.48)
    arms = [_cushion((0.07, 0.30, 0.045), 16).moved(side, 0.24, 0.70) for side in (-0.29, 0.29)]
    posts = [box((0.03, 0.04, 0.22)).moved(side, 0.24, 0.47) for side in (-0.29, 0.29)]
    column = box((0.06, 0.06, 0.36)).moved(0, 0.27, 0.08)
    spine = box((0.07, 0.03, 0.34)).moved(0, 0.05, 0.40)
    feet = [
        box((0.05, 0.32, 0.04)).moved(0, 0.16, 0.06).turned(72 * n + 20).moved(0, 0.27, 0) for n in range(5)
    ]
    return join([back, seat]), join([*arms, *posts, column, spine, *feet])


def _gray_chair(rng: Generator) -> tuple[list[Prop], Floats]:
    """The chair in focus, and the point on its backrest that is."""
    x, y, turn = CHAIR
    upholstery, frame = (shape.turned(turn).moved(x, y, 0) for shape in _swivel_chair())
    middle = int(np.argmin(_swivel_chair()[0].vertices[:, 1]))
    steel = textures.speckled(rng, (96, 96), (0.05, 0.05, 0.06), (0.34, 0.34, 0.37))
    props = [
        Prop("gray chair", upholstery, _fabric(rng, (256, 256), (0.52, 0.53, 0.55)), smooth=True, layer=3),
        Prop("chair's frame", frame, steel, layer=3),
    ]
    return props, upholstery.vertices[middle]


def _desk(width: float, depth: float) -> Shape:
    """A top on two panels, 0.74 m high."""
    sides = [box((0.03, depth - 0.06, 0.70)).moved(side * (width / 2 - 0.04), 0, 0) for side in (-1, 1)]
    front = box((width, 0.02, 0.4)).moved(0, 0.1, 0.3)
    return join([box((width, depth, 0.04)).moved(0, 0, 0.70), *sides, front])


def _monitor(
    name: str, picture: Picture, place: tuple[float, float, float], turn: float, layer: int
) -> list[Prop]:
    """A screen of some width, at (x, y) on a desk, and its foot; all sides of the screen show the picture."""
    x, y, width = place
    screen = box((width, 0.04, 0.6 * width)).moved(0, 0, 0.12)
    foot = join([box((0.05, 0.03, 0.14)).moved(0, 0.03, 0), box((0.24, 0.16, 0.015))])
    shell = np.clip(picture[:24, :24] * 0.5 + 0.04, 0, 1)
    return [
        Prop(name, screen.turned(turn).moved(x, y, 0.74), picture, layer=layer),
        Prop(f"{name}'s foot", foot.turned(turn).moved(x, y, 0.74), shell, layer=layer),
    ]


def _books(
    rng: Generator, span: tuple[float, float], y: float, z: float, spines: int, tall: float = 0.3
) -> list[Shape]:
    """A row of books from one x to another on a board at height z."""
    row, x = [], span[0]
    while (thick := rng.uniform(0.03, 0.07)) and x + thick < span[1]:
        pick = rng.integers(spines)
        book = box((thick, 0.2, tall * rng.uniform(0.7, 1)), (pick / spines, 0, (pick + 1) / spines, 1), 0.08)
        row.append(book.moved(x + thick / 2, y + rng.uniform(-0.02, 0.02), z))
        x += thick + (0.10 if rng.random() < 0.06 else 0.002)
    return row


# Where they stand


def _room(rng: Generator) -> list[Prop]:
    """Floor, walls, and a ceiling of panels with lamps."""
    length, middle = BACK + 0.5, (BACK - 0.5) / 2
    carpet = _carpet(rng, (832, 560), (18, 11))
    tiles = bricks(rng, (384, 192), 14, 4, (0.92, 0.92, 0.90))
    sides = bricks(rng, (256, 640), 14, 22, (0.90, 0.88, 0.80))
    back = bricks(rng, (256, 448), 14, 13, (0.84, 0.80, 0.66))
    lamps = [box((1.1, 0.3, 0.03)).moved(x, y, CEILING - 0.03) for x in (-1.2, 1.2) for y in (4.7, 6.1, 7.5)]
    grid = np.full((48, 96, 3), 0.95, np.float32)
    grid[:, ::12], grid[::16] = 0.6, 0.7
    wall = box((0.1, length, CEILING))
    return [
        Prop("floor", box((2 * SIDE, length, 0.1)).moved(0, middle, -0.1), carpet),
        Prop("ceiling", box((2 * SIDE, length, 0.1)).moved(0, middle, CEILING), tiles, travel=INDOORS),
        Prop("lamps", join(lamps), grid, glow=1.05, travel=INDOORS),
        Prop("left wall", wall.moved(-SIDE - 0.05, middle, 0), sides, travel=INDOORS),
        Prop("right wall", wall.moved(SIDE + 0.05, middle, 0), np.ascontiguousarray(sides[:, ::-1])),
        Prop("back wall", box((2 * SIDE + 0.2, 0.1, CEILING)).moved(0, BACK + 0.05, 0), back),
    ]


def _on_walls(rng: Generator) -> list[Prop]:
    """The white poster and others, a whiteboard."""
    white, black = (0.95, 0.95, 0.93), (0.12, 0.12, 0.16)
    large, small = poster(rng, (264, 200), white, black), poster(rng, (160, 120), (0.20, 0.34, 0.52), white)
    props = [
        Prop("white poster", box((0.95, 0.02, 1.25)).moved(-0.30, BACK - 0.01, 1.15), large),
        Prop("blue poster", box((0.6, 0.02, 0.8)).moved(-1.35, BACK - 0.01, 1.45), small),
        Prop("whiteboard", box((0.02, 2.0, 1.1)).moved(SIDE - 0.01, 6.3, 1.2), _whiteboard(rng, (160, 290))),
    ]
    papers = ((0.86, 0.66, 0.30), (0.66, 0.24, 0.20), (0.86, 0.86, 0.80), (0.30, 0.46, 0.34))
    for number, (paper, y) in enumerate(zip(papers, (5.0, 6.0, 6.9, 7.8), strict=True)):
        ink = black if sum(paper) > 1.5 else white
        sheet = box((0.02, 0.62, 0.86)).moved(-SIDE + 0.01, y, 1.35 + 0.08 * (number % 2))
        props.append(Prop(f"poster {number}", sheet, poster(rng, (152, 112), paper, ink)))
    return props


def _far(rng: Generator) -> list[Prop]:
    """Along the back wall: shelves of books at the right, a cabinet and a desk with a monitor at the left."""
    spines = 10
    boards = [box((1.5, 0.32, 0.03)).moved(0, 0, 0.08 + 0.38 * n) for n in range(6)]
    sides = [box((0.03, 0.32, 2.01)).moved(x, 0, 0) for x in (-0.75, 0.75)]
    shelf = join([*boards, *sides, box((1.5, 0.02, 2.01)).moved(0, 0.16, 0)]).moved(1.45, BACK - 0.2, 0)
    books = [
        book for n in range(5) for book in _books(rng, (0.74, 2.15), BACK - 0.24, 0.11 + 0.38 * n, spines)
    ]
    books += _books(rng, (-0.72, 0.10), 8.1, 0.92, spines, 0.2)
    stained = textures.wood(rng, (256, 192), 4, (0.34, 0.22, 0.13), (0.70, 0.52, 0.34))
    drawers = bricks(rng, (160, 160), 4, 2, (0.42, 0.50, 0.56))
    return [
        Prop("shelves", shelf, stained, layer=1),
        Prop("books", join(books), textures.book_spines(rng, spines, (160, 28)), layer=1),
        Prop("cabinet", box((1.1, 0.45, 0.92)).moved(-0.30, 8.1, 0), drawers, layer=1),
        Prop("far desk", _desk(1.5, 0.7).moved(-1.85, 7.7, 0), stained, layer=1),
        *_monitor("far monitor", _screen(rng, (78, 130)), (-1.75, 7.75, 0.60), 8, 1),
    ]  # fmt: skip


def _middle(rng: Generator) -> list[Prop]:
    """Desks on both sides with monitors, and two more chairs."""
    top = textures.wood(rng, (256, 256), 4, (0.46, 0.38, 0.30), (0.78, 0.68, 0.54))
    blue = _fabric(rng, (128, 128), (0.26, 0.36, 0.56))
    steel = textures.speckled(rng, (64, 64), (0.05, 0.05, 0.06), (0.40, 0.40, 0.42))
    chairs = [
        tuple(shape.turned(turn).moved(x, y, 0) for shape in _swivel_chair(1.02))
        for x, y, turn in ((-1.05, 4.75, 62), (1.02, 5.35, -70))
    ]
    desks = [_desk(1.7, 0.75).turned(90).moved(x, y, 0) for x, y in ((-2.1, 5.1), (2.15, 5.3))]
    return [
        Prop("desks", join(desks), top, layer=2),
        Prop("blue chairs", join([chair[0] for chair in chairs]), blue, smooth=True, layer=2),
        Prop("blue chairs' frames", join([chair[1] for chair in chairs]), steel, layer=2),
        *_monitor("left monitor", _screen(rng, (102, 170)), (-2.1, 5.45, 0.66), 30, 2),
        *_monitor("right monitor", _screen(rng, (102, 170)), (2.1, 5.60, 0.66), -34, 2),
        *_monitor("small monitor", _screen(rng, (84, 140)), (2.05, 4.85, 0.52), -26, 2),
    ]  # fmt: skip


def _near(rng: Generator) -> list[Prop]:
    """Passed on the way: the end of a desk at the left with a monitor and books, a plant at the right."""
    spines = 6
    top = textures.wood(rng, (224, 224), 4, (0.40, 0.28, 0.18), (0.72, 0.54, 0.36))
    leaves = [
        leaf(*rng.uniform((0.3, 0.07, 0.3, 0.1), (0.5, 0.12, 0.8, 0.5))).turned(137.5 * n) for n in range(24)
    ]
    leaves = [Shape(each.vertices, each.faces, each.uv[..., ::-1]).moved(1.12, 2.15, 0.86) for each in leaves]
    pot = turned_body([(0.0, 0.0), (0.12, 0.0), (0.16, 0.3), (0.18, 0.3), (0.18, 0.34), (0.0, 0.3)], 32)
    pile = join(_books(rng, (-1.7, -1.36), 2.3, 0.74, spines, 0.24))
    return [
        Prop("near desk", _desk(1.1, 0.95).turned(90).moved(-1.3, 2.25, 0), top, layer=4),
        *_monitor("near monitor", _screen(rng, (132, 220)), (-1.12, 2.5, 0.56), 22, 4),
        Prop("pile", pile, textures.book_spines(rng, spines, (160, 28)), layer=4),
        Prop("stand", box((0.3, 0.3, 0.52)).moved(1.12, 2.15, 0), top, layer=4),
        Prop("pot", pot.moved(1.12, 2.15, 0.52), textures.mug(rng, 96), smooth=True, layer=4),
        Prop("plant", join(leaves), textures.foliage(rng, (192, 72)), smooth=True, layer=4),
    ]
