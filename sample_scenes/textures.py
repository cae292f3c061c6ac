"""Pictures made with numpy: the surfaces of the sample scenes, the same for the same seed.

Image textures and not Blender's noise nodes: Cycles is ten times slower on those. Every function
returns display-referred sRGB floats (height, width, 3) in 0 ... 1, the first row on top.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Picture = NDArray[np.float32]
Generator = np.random.Generator

FONT = cv2.FONT_HERSHEY_SIMPLEX
SERIF = cv2.FONT_HERSHEY_COMPLEX_SMALL
SYLLABLES = ("ka", "lo", "mer", "an", "to", "ri", "sel", "ven", "ia", "dor", "un", "pe", "gal", "is", "mo")


def noise(rng: Generator, shape: tuple[int, int], cells: tuple[float, float], octaves: int = 5) -> Picture:
    """Fractal noise in 0 ... 1; `cells` are the coarsest octave's bumps down and across."""
    total = np.zeros(shape, np.float32)
    for octave in range(octaves):
        grid = [min(size, max(2, round(cell * 2**octave))) for cell, size in zip(cells, shape, strict=True)]
        bumps = rng.random(grid, dtype=np.float32)
        total += cv2.resize(bumps, shape[::-1], interpolation=cv2.INTER_CUBIC) * 0.55**octave
    low, high = np.percentile(total, [1, 99])
    return np.asarray(np.clip((total - low) / (high - low), 0, 1), dtype=np.float32)


def ramp(value: Picture, *colours: ArrayLike) -> Picture:
    """Colour of a value in 0 ... 1: evenly spaced stops, linear between them."""
    stops = np.linspace(0, 1, len(colours))
    table = np.asarray(colours, dtype=np.float32)
    return np.stack([np.interp(value, stops, table[:, c]) for c in range(3)], axis=-1).astype(np.float32)


def mix(under: Picture, over: ArrayLike, amount: ArrayLike) -> Picture:
    weight = np.asarray(amount, dtype=np.float32)[..., None]
    return under + (np.asarray(over, dtype=np.float32) - under) * weight


def word(rng: Generator, syllables: int = 3) -> str:
    return "".join(rng.choice(SYLLABLES, syllables))


def write(
    picture: Picture,
    text: str,
    centre: tuple[float, float],
    scale: float,
    colour: ArrayLike,
    face: int = FONT,
) -> None:
    """Letter `text` onto the picture, centred, cut at its borders.

    OpenCV 5 letters on 8-bit pictures only, hence the stencil.
    """
    (width, height), below = cv2.getTextSize(text, face, scale, 1)
    stencil = np.zeros((height + below + 4, width + 4), np.uint8)
    cv2.putText(stencil, text, (2, height + 2), face, scale, 255, 1, cv2.LINE_AA)
    left, top = round(centre[0] - width / 2) - 2, round(centre[1] - height / 2) - 2
    rows = slice(max(top, 0), max(top + stencil.shape[0], 0))
    columns = slice(max(left, 0), max(left + stencil.shape[1], 0))
    patch = picture[rows, columns]
    first_row, first_column = max(-top, 0), max(-left, 0)
    inked = stencil[first_row : first_row + patch.shape[0], first_column : first_column + patch.shape[1]]
    picture[rows, columns] = mix(patch, colour, inked / 255)


def wood(rng: Generator, shape: tuple[int, int], planks: int, dark: ArrayLike, light: ArrayLike) -> Picture:
    """Planks that run down the picture, each with a grain and tone of its own."""
    height, width = shape
    plank = np.minimum(np.arange(width) * planks // width, planks - 1)
    rings = noise(rng, shape, (2, planks * 2), 3) * 5 + rng.random(planks)[plank] * 9
    grain = 0.5 + 0.5 * np.sin(2 * np.pi * rings)
    fibre = noise(rng, shape, (height / 64, width / 4), 3)
    pores = noise(rng, shape, (height / 14, width / 5), 1) > 0.87
    tone = 0.40 * grain + 0.38 * fibre + 0.22 * rng.random(planks)[plank]
    seam = np.diff(plank, prepend=-1) != 0
    picture = ramp(np.clip(tone, 0, 1).astype(np.float32), dark, light)
    picture = mix(picture, np.asarray(dark) * 0.5, 0.6 * pores)
    return mix(picture, np.asarray(dark) * 0.35, np.broadcast_to(0.8 * (seam | np.roll(seam, 1)), shape))


def wallpaper(rng: Generator, size: int) -> Picture:
    """Rows of leaf sprays on teal, slightly faded and stained: no two repeats are the same."""
    y, x = np.mgrid[0:size, 0:size].astype(np.float32) / size
    columns, rows = 22.0, 16.0
    cell = np.floor(x * columns)
    u, v = x * columns - cell - 0.5, (y * rows + 0.5 * (cell % 2)) % 1.0 - 0.5
    swirl = np.arctan2(v, u) + 2.5 * np.hypot(u, v)
    spray = (np.hypot(u, v) < 0.16 + 0.24 * np.abs(np.cos(2.5 * swirl))) & (np.hypot(u, v) > 0.07)
    stem = np.abs(u + 0.09 * np.sin(2 * np.pi * v)) < 0.022
    paper = ramp(noise(rng, (size, size), (6, 6), 7), (0.22, 0.34, 0.36), (0.38, 0.50, 0.50))
    paper *= (0.82 + 0.36 * noise(rng, (size, size), (110, 110), 3))[..., None]
    gold = ramp(noise(rng, (size, size), (30, 30), 4), (0.40, 0.52, 0.48), (0.74, 0.70, 0.52))
    return mix(paper, gold, cv2.GaussianBlur((spray | stem).astype(np.float32), (0, 0), 0.8) * 0.85)


def globe(rng: Generator, height: int) -> Picture:
    """A political globe: continents, countries by colour, graticule, towns and invented names."""
    width = 2 * height
    latitude, longitude = np.meshgrid(
        np.linspace(np.pi / 2, -np.pi / 2, height), np.linspace(-np.pi, np.pi, width), indexing="ij"
    )
    around = np.cos(latitude)
    ball = np.stack([around * np.cos(longitude), around * np.sin(longitude), np.sin(latitude)], -1)
    # Waves through the ball, not noise over the map: no seam, and no pinch at the poles.
    count = 120
    waves = rng.normal(size=(count, 3))
    frequency = 2.2 * 2.0 ** (5.0 * rng.random(count))
    waves *= (frequency / np.linalg.norm(waves, axis=1))[:, None]
    phases, weight = rng.random(count) * 2 * np.pi, frequency**-0.8
    relief = np.zeros((height, width), np.float32)
    for wave, phase, amount in zip(waves, phases, weight, strict=True):
        relief += (amount * np.cos(ball @ wave + phase)).astype(np.float32)
    relief /= relief.std()
    land = relief > 0.0
    sites = rng.normal(size=(64, 3))
    sites /= np.linalg.norm(sites, axis=1, keepdims=True)
    wobble = 0.10 * np.stack([np.roll(relief, 37 * k, axis=1) for k in range(3)], -1)
    country = np.argmax((ball + wobble) @ sites.T, axis=-1)
    inks = np.array(
        [(0.86, 0.74, 0.44), (0.80, 0.52, 0.40), (0.62, 0.70, 0.42), (0.88, 0.82, 0.62), (0.76, 0.60, 0.62)]
    )
    picture = ramp(np.clip(relief / 2.0 + 1.0, 0, 1), (0.16, 0.32, 0.46), (0.50, 0.68, 0.74))
    shade = (0.82 + 0.36 * noise(rng, (height, width), (20, 40), 5))[..., None]
    coloured = np.minimum(inks[country % len(inks)] * shade, 1).astype(np.float32)
    picture = mix(picture, coloured, land)
    picture = mix(picture, (0.94, 0.94, 0.92), np.clip((np.abs(latitude) - 1.2) * 6, 0, 1) * land)
    border = (cv2.Laplacian(country.astype(np.float32), cv2.CV_32F) != 0) & land
    coast = cv2.morphologyEx(land.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0
    picture = mix(picture, (0.36, 0.20, 0.16), 0.55 * border + 0.85 * (coast & ~border))
    degrees = np.degrees(np.stack([latitude, longitude]))
    lines = (np.abs((degrees + 7.5) % 15 - 7.5) < 0.16).any(axis=0)
    picture = np.ascontiguousarray(mix(picture, (0.20, 0.22, 0.28), 0.45 * lines), dtype=np.float32)
    for _ in range(110):
        row, column = int(height * rng.uniform(0.14, 0.86)), int(rng.integers(60, width - 60))
        if land[row, column]:
            cv2.circle(picture, (column, row), 2, (0.55, 0.10, 0.08), -1, cv2.LINE_AA)
        name = word(rng, int(rng.integers(2, 4)))
        name = name.title() if land[row, column] else name.upper()
        write(picture, name, (column, row - 9), rng.uniform(0.34, 0.6), (0.10, 0.09, 0.14))
    return picture


def book_spines(rng: Generator, count: int, shape: tuple[int, int] = (384, 64)) -> Picture:
    """`count` spines side by side, each with cloth, bands, a title along it and a device."""
    cloths = np.array(
        [(0.50, 0.16, 0.14), (0.16, 0.27, 0.40), (0.22, 0.36, 0.24), (0.76, 0.66, 0.46), (0.34, 0.22, 0.30),
         (0.80, 0.52, 0.20), (0.28, 0.28, 0.30), (0.86, 0.82, 0.74), (0.18, 0.42, 0.44)]
    )  # fmt: skip
    height, width = shape
    spines = []
    for index in range(count):
        cloth = cloths[rng.integers(len(cloths))] * rng.uniform(0.8, 1.12)
        ink = np.array((0.90, 0.80, 0.50)) if cloth.mean() < 0.45 else np.array((0.20, 0.12, 0.10))
        spine = np.ascontiguousarray(
            (0.8 + 0.4 * noise(rng, shape, (48, 8), 3))[..., None] * cloth, np.float32
        )
        for band in rng.choice([0.06, 0.09, 0.22, 0.26, 0.72, 0.76, 0.90, 0.94], 4, replace=False):
            row, thick = int(band * height), int(rng.integers(2, 7))
            spine[row : row + thick, :] = ink * 0.9
        title = np.zeros((width, height, 3), np.float32)
        write(title, f"{word(rng).upper()} {word(rng)}", (height * 0.48, width * 0.5), 0.85, (1, 1, 1))
        spine = mix(spine, ink, cv2.rotate(title, cv2.ROTATE_90_CLOCKWISE)[..., 0])
        middle = (width // 2, int(height * 0.82))
        spine = np.ascontiguousarray(spine)
        cv2.circle(spine, middle, 10 + index % 8, tuple(map(float, ink)), 2 + index % 4, cv2.LINE_AA)
        spines.append(spine)
    return np.clip(np.concatenate(spines, axis=1), 0, 1)


def landscape(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A painting: sky, ranges of hills, each darker and nearer, brush strokes over everything."""
    height, width = shape
    y = np.linspace(0, 1, height, dtype=np.float32)[:, None]
    skies = [((0.42, 0.58, 0.74), (0.92, 0.84, 0.68)), ((0.72, 0.46, 0.40), (0.94, 0.80, 0.54))]
    top, horizon = skies[rng.integers(2)]
    clouds = noise(rng, shape, (5, 3), 5)
    picture = ramp(np.clip(y * 1.6 + 0.5 * (clouds - 0.5), 0, 1), top, horizon)
    far, near = np.array((0.52, 0.60, 0.66)), np.array(rng.permutation((0.16, 0.28, 0.20)))
    for depth in np.linspace(0, 1, 5):
        ridge = 0.35 + 0.5 * depth - 0.25 * (noise(rng, (2, width), (2, 3 + 3 * depth), 5)[0] - 0.3)
        tone = (0.75 + 0.5 * noise(rng, shape, (24, 18), 4))[..., None]
        hill = ((far + (near - far) * depth) * tone).astype(np.float32)
        picture = mix(picture, hill, np.clip((y - ridge) * height / 2, 0, 1))
    strokes = noise(rng, shape, (height / 3, width / 14), 2)[..., None]
    return np.clip(picture * (0.75 + 0.3 * strokes), 0, 1)


def postcard(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A landscape with a pale margin and the place's name."""
    height, width = shape
    picture = ramp(noise(rng, shape, (5, 6), 5), (0.78, 0.74, 0.64), (0.90, 0.86, 0.76))
    edge = height // 14
    picture[edge:-edge, edge:-edge] = landscape(rng, (height - 2 * edge, width - 2 * edge))
    write(picture, word(rng).title(), (width * 0.5, height * 0.78), 1.1, (0.94, 0.90, 0.78))
    return picture


def mug(rng: Generator, height: int) -> Picture:
    """Glaze with rows of painted triangles, dots and lines, speckled."""
    width = 3 * height
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / height
    picture = ramp(noise(rng, (height, width), (10, 30), 6), (0.80, 0.74, 0.62), (0.92, 0.88, 0.78))
    saw = np.abs((x * 6) % 1 - 0.5) * 2
    row = (y * 5) % 1
    which = np.floor(y * 5)
    red, blue = (0.66, 0.20, 0.14), (0.16, 0.30, 0.46)
    picture = mix(picture, red, ((which == 0) | (which == 3)) & (row > 0.15) & (row < 0.15 + 0.75 * saw))
    dots = np.hypot((x * 7.5) % 1 - 0.5, (row - 0.5) * 1.5) < 0.3
    picture = mix(picture, blue, dots & ((which == 1) | (which == 4)))
    zigzag = np.abs(row - 0.25 - 0.5 * np.abs((x * 9) % 1 - 0.5) * 2) < 0.14
    picture = mix(picture, (0.80, 0.54, 0.18), zigzag & (which == 2))
    speckle = noise(rng, (height, width), (height / 3, width / 3), 1) > 0.9
    return mix(picture, (0.30, 0.22, 0.18), 0.6 * speckle)


def clock_face(rng: Generator, size: int) -> Picture:
    """Minute track, numerals and hands at ten past ten, on aged paper."""
    picture = ramp(noise(rng, (size, size), (4, 4), 7), (0.84, 0.78, 0.64), (0.95, 0.92, 0.82))
    picture = np.ascontiguousarray(picture)
    half, ink = size / 2, (0.10, 0.09, 0.10)

    def at(turn: float, radius: float) -> tuple[int, int]:
        angle = 2 * np.pi * turn
        return round(half + half * radius * np.sin(angle)), round(half - half * radius * np.cos(angle))

    for minute in range(60):
        inner = 0.84 if minute % 5 else 0.80
        cv2.line(picture, at(minute / 60, inner), at(minute / 60, 0.93), ink, 1 + 3 * (minute % 5 == 0), 16)
    for hour in range(1, 13):
        write(picture, str(hour), at(hour / 12, 0.66), size / 300, ink)
        write(picture, str(hour), at(hour / 12, 0.665), size / 300, ink)
    write(picture, "MERIAN", at(0, 0.3), size / 700, ink)
    for turn, radius, thick in ((10.17 / 12, 0.45, 9), (10 / 60, 0.7, 6)):
        cv2.line(picture, at(0, 0), at(turn, radius), ink, thick, cv2.LINE_AA)
    return picture


def page(rng: Generator, shape: tuple[int, int]) -> Picture:
    """An opened book seen from above: two columns of words, headings and a small engraving."""
    height, width = shape
    picture = ramp(noise(rng, shape, (5, 6), 6), (0.80, 0.76, 0.66), (0.92, 0.90, 0.82))
    picture = np.ascontiguousarray(picture)
    ink = (0.16, 0.14, 0.14)
    for left in (0.06, 0.54):
        write(picture, word(rng, 4).upper(), (width * (left + 0.2), height * 0.08), 0.8, ink)
        for row in np.arange(0.15, 0.95, 0.042):
            line = " ".join(word(rng, int(rng.integers(1, 4))) for _ in range(12))
            write(picture, line[:34], (width * (left + 0.2), height * row), 0.65, ink, SERIF)
    etching = landscape(rng, (height // 3, int(width * 0.4))).mean(axis=-1, keepdims=True) * (1, 0.96, 0.88)
    top, start = int(height * 0.3), int(width * 0.54)
    picture[top : top + etching.shape[0], start : start + etching.shape[1]] = etching
    gutter = np.abs(np.linspace(-1, 1, width, dtype=np.float32))
    return np.asarray(picture * np.clip(0.6 + gutter * 8, 0.6, 1)[None, :, None], dtype=np.float32)


def cloth(rng: Generator, shape: tuple[int, int], ground: ArrayLike, figure: ArrayLike) -> Picture:
    """A woven runner: stripes along the edges, lozenges between them, threads that show."""
    height, width = shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / width
    lozenge = (np.abs((x * 6) % 1 - 0.5) + np.abs((y * 6) % 1 - 0.5)) % 0.25 < 0.11
    edge = np.minimum(x, 1 - x)
    pattern = np.where(edge < 0.12, (edge * 40) % 1 < 0.5, lozenge)
    worn = noise(rng, shape, (10, 10), 6)
    weave = (
        noise(rng, shape, (height / 3, width / 5), 1) * 0.5
        + noise(rng, shape, (height / 5, width / 3), 1) * 0.5
    )
    picture = mix(ramp(worn, np.asarray(ground) * 0.85, ground), figure, pattern * (0.65 + 0.3 * worn))
    return np.clip(picture * (0.8 + 0.4 * weave[..., None]), 0, 1)


def foliage(rng: Generator, shape: tuple[int, int]) -> Picture:
    """A leaf along the picture's height: midrib, side veins, blotches."""
    height, width = shape
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    x = np.abs(x / width * 2 - 1)
    veins = ((y / height * 14 - x * 2.2) % 1 < 0.12) | (x < 0.06)
    blotches = noise(rng, shape, (8, 5), 5)
    return mix(ramp(blotches, (0.13, 0.26, 0.12), (0.38, 0.52, 0.22)), (0.62, 0.70, 0.42), 0.6 * veins)


def speckled(rng: Generator, shape: tuple[int, int], dark: ArrayLike, light: ArrayLike) -> Picture:
    """Any plain but not perfect surface: clay, plaster, brass."""
    return ramp(noise(rng, shape, (8, 8), 6), dark, light)
