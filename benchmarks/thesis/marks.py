"""Marks, meshes and labelled sheets of pictures, drawn with OpenCV. Pictures are (H, W, 3) uint8, sRGB.

Places are pixels of the frame, the centre of the first one at (0.5, 0.5), as everywhere.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from addon.core.base.arrays import Floats, Ints
from addon.core.media.light import encode_srgb

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

WHITE, BLACK, RED = (255, 255, 255), (0, 0, 0), (230, 30, 30)
BLUE, GREEN, YELLOW = (40, 90, 255), (30, 220, 60), (255, 220, 0)
INK = (25, 25, 25)
FRACTION = 4
"""Bits of a pixel that OpenCV's drawing is told."""
GAP, MARGIN = 6, 8
TITLE = 19
"""Height of the lettering in pixels."""
LIMIT = 250_000
"""Bytes of a file."""


@dataclass(frozen=True)
class Figure:
    """One picture and the lines of the README that go with it."""

    name: str
    """Of the file."""
    picture: Picture
    shows: str
    answers: str
    """To which figure or table of the thesis."""
    numbers: str
    """What was measured."""
    table: str = ""


def recorded(picture: NDArray[np.floating]) -> Picture:
    """A linear picture (H, W, 3 or more) as it is shown."""
    return np.rint(255 * encode_srgb(np.clip(picture[..., :3], 0, 1))).astype(np.uint8)


def enlarged(picture: Picture, zoom: float) -> Picture:
    """Larger or smaller, its proportions kept."""
    size = (round(picture.shape[1] * zoom), round(picture.shape[0] * zoom))
    kind = cv2.INTER_AREA if zoom < 1 else cv2.INTER_CUBIC
    return picture if zoom == 1 else np.asarray(cv2.resize(picture, size, interpolation=kind), np.uint8)


def muted(picture: Picture) -> Picture:
    """Grey and of low contrast, so that black, white and coloured marks are all seen on it."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(np.float64)
    return np.repeat(np.rint(70 + 0.45 * grey).astype(np.uint8)[..., None], 3, axis=2)


def lines(picture: Picture, ends: Floats, colour: Colour, zoom: float = 1.0, thick: int = 1) -> Picture:
    """With straight lines between the places of `ends` (n, m, 2), `picture` being the frame times `zoom`."""
    drawn = picture.copy()
    # OpenCV counts from the centre of the first pixel.
    at = np.rint((ends * zoom - 0.5) * 2**FRACTION).astype(np.int32)
    cv2.polylines(drawn, list(at), False, colour, thick, cv2.LINE_AA, FRACTION)
    return drawn


def marks(
    picture: Picture,
    xy: Floats,
    kind: str,
    colour: Colour,
    zoom: float = 1.0,
    arm: float = 4.0,
    thick: int = 1,
) -> Picture:
    """With a '+', an 'x' or a square at each of (n, 2) places; `arm` is in pixels of `picture`."""
    shapes = {
        "+": [[(-1, 0), (1, 0)], [(0, -1), (0, 1)]],
        "x": [[(-1, -1), (1, 1)], [(-1, 1), (1, -1)]],
        "square": [[(-1, -1), (1, -1)], [(1, -1), (1, 1)], [(1, 1), (-1, 1)], [(-1, 1), (-1, -1)]],
    }  # fmt: skip
    strokes = np.array(shapes[kind], dtype=np.float64) * arm / zoom
    return lines(picture, (xy[:, None, None] + strokes).reshape(-1, 2, 2), colour, zoom=zoom, thick=thick)


def mesh(picture: Picture, xy: Floats, triangles: Ints, colour: Colour, zoom: float = 1.0) -> Picture:
    """With the edges of triangles (T, 3) over vertices (V, 2), each edge once."""
    pairs = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return lines(picture, xy[np.unique(pairs, axis=0)], colour, zoom)


def spread(xy: Floats, apart: float) -> Ints:
    """Rows of (n, 2) places of which there is one in each square of side `apart`: enough to see them by."""
    cell = np.floor(xy / apart)
    return np.sort(np.unique(cell, axis=0, return_index=True)[1]).astype(np.int32)


def text(picture: Picture, words: str, at: tuple[int, int], size: int = TITLE, colour: Colour = INK) -> None:
    """Write onto the picture, from the left end of the baseline."""
    cv2.putText(picture, words, at, colour, cv2.FontFace("sans"), size)


def width_of(words: str, size: int = TITLE) -> int:
    """Pixels that the words take."""
    _, _, width, _ = cv2.getTextSize((0, 0), words, (0, 0), cv2.FontFace("sans"), size)
    return int(width)


def sheet(
    rows: Sequence[Sequence[Picture]], across: Sequence[str], down: Sequence[str], title: str
) -> Picture:
    """Pictures of one size in rows and columns, with a title, names over the columns and beside the rows.

    A row's name may have several lines.
    """
    height, width = rows[0][0].shape[:2]
    lettered = [name.split("\n") for name in down]
    left = MARGIN + max([width_of(line) + 10 for names in lettered for line in names if line], default=0)
    head = 2 * MARGIN + TITLE
    top = head + (TITLE + MARGIN if any(across) else 0)
    size = (top + len(rows) * (height + GAP) + MARGIN, left + len(rows[0]) * (width + GAP) + MARGIN)
    page = np.full((*size, 3), 255, np.uint8)
    text(page, title, (MARGIN, head - MARGIN), TITLE + 1)
    for column, name in enumerate(across):
        text(page, name, (left + column * (width + GAP), top - MARGIN))
    for number, (row, names) in enumerate(zip(rows, lettered, strict=True)):
        y = top + number * (height + GAP)
        for line, words in enumerate(names):
            text(
                page,
                words,
                (MARGIN, y + height // 2 + round((line - (len(names) - 1) / 2) * (TITLE + 6)) + 6),
            )
        for column, picture in enumerate(row):
            x = left + column * (width + GAP)
            page[y : y + height, x : x + width] = picture
    return page


def save(path: Path, picture: Picture) -> None:
    """As PNG: in full colour where that is small enough, else with as many colours as are.

    Raises ValueError where even 32 colours make a larger file than `LIMIT`.
    """
    image = Image.fromarray(picture)
    for colours in (0, 256, 192, 128, 96, 64, 32):
        attempt = image.quantize(colours, Image.Quantize.MEDIANCUT, kmeans=3) if colours else image
        data = io.BytesIO()
        attempt.save(data, format="PNG", optimize=True)
        if data.tell() <= LIMIT:
            path.write_bytes(data.getvalue())
            return
    raise ValueError(f"{path.name} has {data.tell()} bytes with 32 colours; make it smaller")
