"""Two boxes of measured edges on a kitchen table: the thesis's own scene, with what it lacked.

A red and yellow cake box 18 cm tall and a brown and yellow brownie box 19 cm tall. The thesis names corners
A to F in section 4.4 and gives ratios of their distances: BC / AB = 2.8, DE / AB = 3.8, DF / BC = 1. With DE
the height of the brownie box, 19 cm, that makes AB = 5 cm and BC = DF = 14 cm: the short and the long edge of
a cake mix, and the long edge of the other. Its camera moved straight ahead, which leaves the focal length
open; this one goes around the table.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from . import textures
from .shapes import Shape, box, join, leaf, sphere, tube, turned_body
from .stage import FRAMES, HEIGHT, WIDTH, Cameras, Edge, Prop, Stage, look, tremor
from .textures import Picture

SEED = 57
FOCAL = 770 / WIDTH
TABLE = 0.75
"""Height of the table's top."""
CAKE = (0.14, 0.05, 0.18)
"""Long edge, short edge and height in metres."""
BROWNIE = (0.14, 0.045, 0.19)
CAKE_PLACE, BROWNIE_PLACE = (-0.095, 0.88, 34.0), (0.145, 1.03, -36.0)
"""x, y, and the turn about the vertical in degrees."""
PIVOT = np.array([0.01, 0.95, TABLE + 0.085])
TURN = 5.2
"""The camera goes around the pivot from minus to plus so many degrees: 17 cm."""
REACH = 0.95
RISE = 0.21
"""The camera's height over the pivot."""
CM = 20
"""Pixels of print a centimetre."""


def stage() -> Stage:
    """A measuring cup at 0.5 m, boxes at 0.85 to 1.1 m, a laid table to 1.7 m, sideboard and wall to 3 m."""
    cake, brownie, room, board, table, back, near = np.random.default_rng(SEED).spawn(7)
    boxes = _placed(printed_box(CAKE), CAKE_PLACE), _placed(printed_box(BROWNIE), BROWNIE_PLACE)
    things = (
        *_room(room), *_sideboard(board), *_table(table), *_back_of_table(back),
        Prop("cake box", boxes[0], _cake(cake), layer=4),
        Prop("brownie box", boxes[1], _brownie(brownie), layer=4),
        *_near(near),
    )  # fmt: skip
    cameras = _around()
    origin, right, top = boxes[0].vertices[[0, 1, 4]]
    # On the printed front, between the name and the cake.
    focus = origin + 0.57 * (right - origin) + 0.64 * (top - origin)
    return Stage(
        "boxes", "two printed boxes with measured edges on a busy table", cameras, things,
        focus=np.tile(focus, (len(cameras), 1)), air=(0.2, 0.2, 0.2), edges=_edges(*boxes),
    )  # fmt: skip


def _around() -> Cameras:
    """A hand-held arc about the pivot, always looking at it."""
    sway = tremor(FRAMES, np.random.default_rng(SEED))
    angle = np.radians(np.linspace(-TURN, TURN, FRAMES))
    arm = REACH * np.stack([np.sin(angle), -np.cos(angle), np.zeros(FRAMES)], axis=1)
    centre = PIVOT + arm + [0, 0, RISE] + 0.003 * sway[:, :3]
    rotation, translation = look(centre, PIVOT - centre, sway[:, 3:])
    return Cameras(WIDTH, HEIGHT, FOCAL * WIDTH, rotation, translation)


def _placed(shape: Shape, place: tuple[float, float, float]) -> Shape:
    return shape.turned(place[2]).moved(place[0], place[1], TABLE + 0.004)


def printed_box(size: tuple[float, float, float]) -> Shape:
    """An upright box, its texture a sheet of card: front and side below, the top above the front.

    The sheet is as large as length + depth by height + depth; back and left side are as front and right.
    """
    length, depth, height = size
    wide, tall = length + depth, height + depth
    front = (0.0, 0.0, length / wide, height / tall)
    side = (length / wide, 0.0, 1.0, height / tall)
    top = (0.0, height / tall, length / wide, 1.0)
    shape = box(size)
    uv = [box(size, rect).uv[0] for rect in (front, side, front, side, top, top)]
    return Shape(shape.vertices, shape.faces, np.stack(uv))


def _edges(cake: Shape, brownie: Shape) -> tuple[Edge, ...]:
    """The measured edges, the thesis's under its letters; all can be seen in all frames."""
    # A box's vertices count x fastest and z slowest, each from low to high.
    a, b, c, below = cake.vertices[[6, 4, 5, 0]]
    d, e, f, behind = brownie.vertices[[5, 1, 4, 7]]
    ends = {
        "AB": (a, b),
        "BC": (b, c),
        "DE": (d, e),
        "DF": (d, f),
        "CD": (c, d),
        "CF": (c, f),
        "cake box height": (b, below),
        "brownie box short edge": (d, behind),
    }
    return tuple(Edge(name, np.stack(pair)) for name, pair in ends.items())


# Printing


def _sheet(size: tuple[float, float, float]) -> tuple[Picture, Picture, Picture, Picture]:
    """An empty sheet for `printed_box`, and the parts of it that are front, side and top."""
    length, depth, height = (round(100 * CM * edge) for edge in size)
    sheet = np.zeros((height + depth, length + depth, 3), np.float32)
    return sheet, sheet[depth:, :length], sheet[depth:, length:], sheet[:depth, :length]


def _trim(part: Picture, cell: int, one: Sequence[float], other: Sequence[float]) -> None:
    """A gingham border, two cells wide: a corner to track right up to the corners of the card."""
    height, width = part.shape[:2]
    row, column = np.arange(height)[:, None], np.arange(width)[None]
    edge = np.minimum(np.minimum(row, height - 1 - row), np.minimum(column, width - 1 - column)) < 2 * cell
    # Whole cells, so that the border is the same at both ends.
    rows, columns = round(height / cell), round(width / cell)
    chequer = (row * rows // height + column * columns // width) % 2 == 0
    part[edge & chequer] = one
    part[edge & ~chequer] = other


def _letter(
    part: Picture, text: str, centre: tuple[float, float], width: float, ink: Sequence[float], bold: int = 2
) -> None:
    """Bold lettering of so many pixels' width."""
    scale = width / cv2.getTextSize(text, textures.FONT, 1.0, 1)[0][0]
    for shift in np.arange(bold) - (bold - 1) / 2:
        textures.write(part, text, (centre[0] + shift, centre[1]), scale, ink)


def _small_print(rng: textures.Generator, part: Picture, top: int, ink: Sequence[float]) -> None:
    """Lines of words down to the border, and the rules and figures of a table."""
    height, width = part.shape[:2]
    for number, row in enumerate(range(top, height - 26, 13)):
        text = f"{textures.word(rng, 2)} {rng.integers(100)}%"
        textures.write(part, text, (width / 2, row), 0.36, ink, textures.SERIF)
        if number % 3 == 2:
            part[row + 7, 22 : width - 22] = ink


def _layer_cake(rng: textures.Generator, front: Picture) -> None:
    """Five layers with crumbs, and cherries on top."""
    height, width = front.shape[:2]
    dark, cream = (0.30, 0.05, 0.06), (0.93, 0.87, 0.72)
    colours = dark, cream, (0.52, 0.28, 0.14), (0.93, 0.74, 0.16), cream
    for layer, colour in enumerate(colours):
        level, half = round((0.80 - 0.055 * layer) * height), round((0.28 + 0.03 * (layer % 2 == 0)) * width)
        cv2.rectangle(front, (width // 2 - half, level - 17), (width // 2 + half, level), colour, -1)
        for x in rng.uniform(width / 2 - half + 6, width / 2 + half - 6, 14):
            crumb = round(x), level - int(rng.integers(3, 15))
            cv2.circle(front, crumb, 2, dark if layer % 2 else cream, -1, cv2.LINE_AA)
    for x in np.linspace(0.3, 0.7, 5) * width:
        cv2.circle(front, (round(x), round(0.525 * height)), 9, (0.70, 0.04, 0.10), -1, cv2.LINE_AA)
        cv2.circle(front, (round(x) - 3, round(0.515 * height)), 2, cream, -1, cv2.LINE_AA)


def _cake(rng: textures.Generator) -> Picture:
    """Red card: a sunburst, a layered cake on a dish, the name on a yellow band."""
    red, yellow, cream, dark = (0.74, 0.10, 0.09), (0.93, 0.74, 0.16), (0.93, 0.87, 0.72), (0.30, 0.05, 0.06)
    sheet, front, side, top = _sheet(CAKE)
    sheet[:] = textures.ramp(textures.noise(rng, sheet.shape[:2], (5, 5), 6), np.array(red) * 0.82, red)
    height, width = front.shape[:2]
    row, column = np.mgrid[0:height, 0:width].astype(np.float32)
    middle = (0.5 * width, 0.60 * height)
    beam = np.floor(np.arctan2(row - middle[1], column - middle[0]) * 14 / np.pi) % 2 == 0
    front[beam & (row > 0.36 * height)] = (0.86, 0.30, 0.12)
    _layer_cake(rng, front)
    front[round(0.10 * height) : round(0.30 * height)] = yellow
    _letter(front, "MERIAN", (width / 2, 0.165 * height), 0.66 * width, red, 4)
    _letter(front, "GOLDEN CAKE", (width / 2, 0.255 * height), 0.6 * width, dark, 2)
    _letter(front, "moist & light", (width / 2, 0.36 * height), 0.5 * width, cream, 1)
    _letter(front, "NET WT 432 g", (width / 2, 0.90 * height), 0.4 * width, cream, 1)
    side[:] = textures.ramp(textures.noise(rng, side.shape[:2], (8, 3), 6), np.array(yellow) * 0.86, yellow)
    _letter(side, "CAKE", (side.shape[1] / 2, 45), 52, red, 3)
    _small_print(rng, side, 75, dark)
    top[:] = yellow
    _letter(top, "MERIAN", (0.36 * width, 0.40 * top.shape[0]), 0.44 * width, red, 3)
    _letter(top, f"lift here {textures.word(rng)}", (0.5 * width, 0.72 * top.shape[0]), 0.6 * width, dark, 1)
    cv2.circle(top, (round(0.8 * width), round(0.4 * top.shape[0])), 16, red, -1, cv2.LINE_AA)
    for part in (front, side, top):
        _trim(part, 10, cream, red)
    return sheet


def _brownie(rng: textures.Generator) -> Picture:
    """Brown card: squares of brownie, the name in a yellow disc, walnuts."""
    brown, dark = np.array((0.36, 0.20, 0.11)), (0.16, 0.08, 0.05)
    yellow, cream = (0.90, 0.70, 0.18), (0.92, 0.86, 0.72)
    sheet, front, side, top = _sheet(BROWNIE)
    sheet[:] = textures.ramp(textures.noise(rng, sheet.shape[:2], (6, 6), 6), brown * 0.75, brown * 1.15)
    height, width = front.shape[:2]
    wide, high = round(0.22 * width), round(0.10 * height)
    for number in range(9):
        left = round(width * (0.12 + 0.27 * (number % 3)))
        upper = round(height * (0.56 + 0.12 * (number // 3)))
        cv2.rectangle(front, (left, upper), (left + wide, upper + high), (0.50, 0.29, 0.16), -1)
        cv2.rectangle(front, (left, upper + high * 7 // 10), (left + wide, upper + high), dark, -1)
        for x, y in rng.uniform((4, 3), (wide - 4, 0.65 * high), (7, 2)):
            walnut = left + round(x), upper + round(y)
            cv2.circle(front, walnut, 3, (0.78, 0.58, 0.32), -1, cv2.LINE_AA)
    middle = (width // 2, round(0.30 * height))
    for share, colour, thick in ((1.0, yellow, -1), (0.91, dark, 2)):
        radii = round(share * 0.40 * width), round(share * 0.19 * height)
        cv2.ellipse(front, middle, radii, 0, 0, 360, colour, thick, cv2.LINE_AA)
    _letter(front, "SELVEN", (middle[0], middle[1] - 32), 0.5 * width, dark, 4)
    _letter(front, "BROWNIES", (middle[0], middle[1] + 4), 0.62 * width, (0.62, 0.12, 0.08), 4)
    _letter(front, "fudge & walnut", (middle[0], middle[1] + 36), 0.44 * width, dark, 1)
    _letter(front, "NET WT 510 g", (0.5 * width, 0.935 * height), 0.36 * width, cream, 1)
    _letter(side, "BROWNIES", (side.shape[1] / 2, 40), 52, yellow, 2)
    _small_print(rng, side, 65, cream)
    _letter(top, "SELVEN", (0.5 * width, 0.4 * top.shape[0]), 0.5 * width, yellow, 3)
    _letter(top, "best before 11 97", (0.5 * width, 0.72 * top.shape[0]), 0.55 * width, cream, 1)
    for part in (front, side, top):
        _trim(part, 10, yellow, dark)
    return sheet


# Everything else


def _room(rng: textures.Generator) -> list[Prop]:
    """A papered wall with pictures, the floor."""
    boards = textures.wood(rng, (256, 256), 8, (0.28, 0.19, 0.12), (0.52, 0.38, 0.25))
    props = [
        Prop("floor", box((5.0, 4.0, 0.02)).moved(0, 1.4, -0.02), boards),
        Prop("wall", box((4.0, 0.1, 2.4)).moved(0, 3.05, 0), textures.wallpaper(rng, 512)),
    ]
    pictures = ((-0.92, 0.44, 0.34), (-0.33, 0.50, 0.40), (0.28, 0.36, 0.30), (0.86, 0.46, 0.44))
    for number, (x, width, height) in enumerate(pictures):
        card = textures.postcard(rng, (140, round(140 * width / height)))
        hung = box((width, 0.02, height)).moved(x, 2.98, 1.04 - height / 2)
        props.append(Prop(f"picture {number}", hung, card))
    return props


def _sideboard(rng: textures.Generator) -> list[Prop]:
    """Before the wall: books, jars and a plant on a sideboard."""
    planks = textures.wood(rng, (192, 384), 9, (0.30, 0.17, 0.09), (0.60, 0.40, 0.22))
    spines, books, x = 12, [], -1.25
    while x < -0.10:
        thick, pick = rng.uniform(0.035, 0.06), rng.integers(spines)
        book = box((thick, 0.17, rng.uniform(0.20, 0.29)), (pick / spines, 0, (pick + 1) / spines, 1), 0.08)
        books.append(book.moved(x + thick / 2, 2.55 + rng.uniform(-0.02, 0.02), 0.60))
        x += thick + 0.003
    jar = [(0.0, 0.0), (0.06, 0.0), (0.065, 0.02), (0.065, 0.15), (0.05, 0.17), (0.055, 0.18), (0.0, 0.21)]
    jars = [turned_body(jar, 32).turned(40 * n).moved(0.08 + 0.19 * n, 2.5, 0.60) for n in range(3)]
    sizes = rng.uniform((0.16, 0.05, 0.2, 0.05), (0.26, 0.07, 0.4, 0.2), (20, 4))
    leaves = [leaf(*size).turned(n * 137.5) for n, size in enumerate(sizes)]
    leaves = [Shape(each.vertices, each.faces, each.uv[..., ::-1]).moved(0.88, 2.5, 0.80) for each in leaves]
    pot = turned_body([(0.0, 0.0), (0.09, 0.0), (0.12, 0.2), (0.13, 0.2), (0.13, 0.23), (0.0, 0.2)], 32)
    clay = textures.mug(rng, 128)
    return [
        Prop("sideboard", box((2.9, 0.4, 0.60)).moved(0, 2.6, 0), planks, layer=1),
        Prop("books", join(books), textures.book_spines(rng, spines, (256, 40)), layer=1),
        Prop("jars", join(jars), clay, smooth=True, layer=1),
        Prop("pot", pot.moved(0.88, 2.5, 0.60), clay[::-1], smooth=True, layer=1),
        Prop("plant", join(leaves), textures.foliage(rng, (192, 64)), smooth=True, layer=1),
    ]


def _table(rng: textures.Generator) -> list[Prop]:
    """The table's top and what lies flat on it."""
    planks = textures.wood(rng, (512, 448), 6, (0.36, 0.21, 0.11), (0.66, 0.45, 0.27))
    runner = textures.cloth(rng, (560, 280), (0.30, 0.42, 0.46), (0.80, 0.76, 0.64))
    props = [
        Prop("table", box((1.5, 1.35, 0.04)).moved(0, 1.03, TABLE - 0.04), planks, layer=2),
        Prop("runner", box((0.56, 1.2, 0.002)).turned(5).moved(0.02, 1.0, TABLE), runner, layer=2),
    ]
    places = ((0.20, 0.74, 16), (-0.33, 0.98, -20), (0.40, 0.98, 30), (-0.03, 1.24, 8))
    for number, (x, y, turn) in enumerate(places):
        card = box((0.148, 0.105, 0.002)).turned(turn).moved(x, y, TABLE + 0.002 + 0.0005 * number)
        props.append(Prop(f"card {number}", card, textures.postcard(rng, (140, 198)), layer=2))
    return props


def _back_of_table(rng: textures.Generator) -> list[Prop]:
    """A bowl, eggs, a tin and a bottle behind the boxes."""
    bowl = [(0.0, 0.0), (0.06, 0.0), (0.065, 0.012), (0.11, 0.06), (0.14, 0.12), (0.145, 0.12), (0.0, 0.03)]
    tin = [(0.0, 0.0), (0.055, 0.0), (0.055, 0.14), (0.0, 0.14)]
    flask = [(0.0, 0.0), (0.04, 0.0), (0.042, 0.13), (0.016, 0.18), (0.014, 0.23), (0.018, 0.24), (0.0, 0.24)]
    freckles = textures.noise(rng, (96, 192), (40, 40), 2)
    shell = textures.ramp(freckles, (0.88, 0.72, 0.56), (0.84, 0.66, 0.50), (0.62, 0.42, 0.28))
    places = ((-0.06, 1.36), (0.0, 1.42), (-0.01, 1.33))
    eggs = [sphere(0.026, 24).moved(x, y, TABLE + 0.026) for x, y in places]
    turned = [turned_body(profile) for profile in (bowl, tin, flask)]
    glaze = [textures.mug(rng, height) for height in (144, 128, 96)]
    return [
        Prop("bowl", turned[0].moved(-0.36, 1.42, TABLE), glaze[0], smooth=True, layer=3),
        Prop("eggs", join(eggs), shell, smooth=True, layer=3),
        Prop("tin", turned[1].moved(0.46, 1.38, TABLE), glaze[1][:, ::-1], smooth=True, layer=3),
        Prop("flask", turned[2].moved(0.31, 1.50, TABLE), glaze[2] * np.float32(0.6), smooth=True, layer=3),
    ]


def _near(rng: textures.Generator) -> list[Prop]:
    """A measuring cup at the left, close to the camera, with wooden spoons in it."""
    x, y = -0.215, 0.57
    cup = [(0.0, 0.0), (0.036, 0.0), (0.04, 0.01), (0.046, 0.10), (0.048, 0.105), (0.044, 0.10), (0.0, 0.01)]
    shape = turned_body(cup).moved(x, y, TABLE)
    stained = textures.wood(rng, (128, 64), 2, (0.42, 0.26, 0.13), (0.78, 0.56, 0.33))
    spoons = []
    for foot, head in (((-0.02, 0.0, 0.02), (0.04, 0.03, 0.20)), ((0.02, 0.01, 0.02), (-0.02, 0.05, 0.22))):
        path = np.array(foot) + (np.array(head) - foot) * np.linspace(0, 1, 8)[:, None]
        rod = tube(path, 0.005, 10).moved(x, y, TABLE)
        spoons.append(Shape(rod.vertices, rod.faces, rod.uv[..., ::-1]))
    return [
        Prop("measuring cup", shape, textures.mug(rng, 192), smooth=True, layer=5),
        Prop("spoons", join(spoons), stained, smooth=True, layer=5),
    ]
