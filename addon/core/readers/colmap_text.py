"""COLMAP's text files: one line a camera or point, two an image, comments after `#`."""

import codecs
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import batched, compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.numbers import reals, wholes
from ..camera.reconstruction import Intrinsics, Points
from .colmap_tables import NO_POINT, ImageRow, Longs, PointTable, Tables, contents, name_of
from .parsing import wrong
from .poses import lens

FILES = ("cameras.txt", "images.txt", "points3D.txt")
BATCH = 50_000
"""Points parsed at once: their words take ten times the memory of their numbers."""
PROMISE = re.compile(rb"# Number of \w+: (\d{1,15})\b")
ROW = np.dtype([("line", "i8"), ("key", "i8"), ("xyz", "f8", 3), ("rgb", "i8", 3), ("error", "f8")])


def read(folder: Path) -> Tables:
    """Read the model in a folder; raises UserError with file and line."""
    files = cameras, images, points = [folder / name for name in FILES]
    return Tables(files, _cameras(cameras), _images(images), _points(points))


class Lines(Iterator[tuple[int, bytes]]):
    """Numbered lines of a file, including blank lines and comments."""

    def __init__(self, path: Path) -> None:
        self.path = path
        data = contents(path, FILES)
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise wrong(f"{path}, byte 0", "text in UTF-8, not in UTF-16; save it anew")
        at = data.find(b"\0")
        if at >= 0:
            raise wrong(f"{path}, byte {at}", f"text, not binary data; name it {path.stem}.bin")
        self._lines = enumerate(data.removeprefix(codecs.BOM_UTF8).splitlines(), 1)
        self._promise: tuple[str, int] | None = None

    def __next__(self) -> tuple[int, bytes]:
        return next(self._lines)

    def telling(self) -> Iterator[tuple[int, bytes]]:
        """Yield the lines that are neither blank nor comments."""
        for number, line in self:
            words = line.lstrip()
            if words.startswith(b"#"):
                found = PROMISE.match(words)
                self._promise = (f"{self.path}, line {number}", int(found[1])) if found else self._promise
            elif words:
                yield number, line

    def place(self, number: int) -> str:
        return f"{self.path}, line {number}"

    def finish(self, what: str, count: int) -> None:
        """Raise UserError if the count differs from COLMAP's header: the only sign of a truncated text."""
        if self._promise and self._promise[1] != count:
            place, promised = self._promise
            raise wrong(
                place, f"{promised} {what} as in its header, but {count} follow; delete it if that is meant"
            )


def _cameras(path: Path) -> dict[int, Intrinsics]:
    lines = Lines(path)
    cameras: dict[int, Intrinsics] = {}
    for number, line in lines.telling():
        place, words = lines.place(number), line.split()
        if len(words) < 4:
            raise wrong(place, "CAMERA_ID, a camera model, WIDTH, HEIGHT and its parameters")
        key, width, height = _integers(place, [words[0], *words[2:4]]).tolist()
        if key in cameras:
            raise wrong(place, f"a CAMERA_ID that no other camera has, not {key}")
        values = _floats(place, words[4:]).tolist()
        cameras[key] = lens(place, words[1].decode("latin-1"), (width, height), values)
    lines.finish("cameras", len(cameras))
    return cameras


def _images(path: Path) -> list[ImageRow]:
    lines = Lines(path)
    images: list[ImageRow] = []
    for number, line in lines.telling():
        place, words = lines.place(number), line.split(maxsplit=9)
        if len(words) < 10:
            raise wrong(place, "IMAGE_ID, a quaternion, a translation, CAMERA_ID and a name")
        key, camera = _integers(place, [words[0], words[8]]).tolist()
        pose = _floats(place, words[1:8])
        name = name_of(place, words[9])
        # The line of features follows directly; it may be empty, or missing at the end.
        below, text = next(lines, (number + 1, b""))
        features = lines.place(below)
        xy, points = _features(features, text.split())
        images.append(ImageRow(place, key, pose[:4], pose[4:], camera, name, features, xy, points))
    lines.finish("images", len(images))
    return images


def _features(place: str, words: list[bytes]) -> tuple[Floats, Longs]:
    """Return positions (n, 2) and keys (n,) of the features with a point."""
    if len(words) % 3:
        raise wrong(place, "features as X Y POINT3D_ID")
    points = _integers(place, words[2::3])
    seen = points != NO_POINT
    # Most features have none, and parsing a number takes 0.5 us.
    x, y = (_floats(place, list(compress(words[first::3], seen))) for first in (0, 1))
    return np.stack([x, y], axis=1), points[seen]


def _points(path: Path) -> PointTable:
    """Read the columns before the tracks; the images hold the same observations."""
    lines = Lines(path)
    parts = [np.zeros(0, ROW)]
    parts += [_rows(lines, batch) for batch in batched(lines.telling(), BATCH, strict=False)]
    table = np.concatenate(parts)
    lines.finish("points", len(table))
    numbers = table["line"].copy()
    dark = np.any((table["rgb"] < 0) | (table["rgb"] > 255), axis=1)
    if dark.any():
        raise wrong(lines.place(numbers[np.argmax(dark)]), "colors from 0 to 255")
    points = Points(table["xyz"].copy(), table["rgb"].astype(np.uint8), table["error"].copy())
    return PointTable(table["key"].copy(), points, lambda row: f"{path}, line {numbers[row]}")


def _rows(lines: Lines, batch: Sequence[tuple[int, bytes]]) -> NDArray[np.void]:
    table = np.zeros(len(batch), ROW)
    table["line"] = [number for number, _ in batch]
    rows = [line.split(None, 8) for _, line in batch]
    short = [i for i, row in enumerate(rows) if len(row) < 8]
    if short:
        place = lines.place(table["line"][short[0]])
        raise wrong(place, "POINT3D_ID, X, Y, Z, R, G, B, ERROR and a track")
    columns = list(zip(*rows, strict=False))
    try:
        table["key"], table["error"] = wholes(columns[0]), reals(columns[7])
        for i in range(3):
            table["xyz"][:, i] = reals(columns[1 + i])
            table["rgb"][:, i] = wholes(columns[4 + i])
    except (ValueError, OverflowError):
        # Line by line, to raise an error that names the line.
        for (number, _), row in zip(batch, rows, strict=True):
            _integers(lines.place(number), [row[0], *row[4:7]])
            _floats(lines.place(number), [*row[1:4], row[7]])
    return table


def _floats(place: str, words: Sequence[bytes]) -> Floats:
    try:
        return reals(words)
    except ValueError:
        raise wrong(place, f"numbers, not {_culprit(words, reals)}") from None


def _integers(place: str, words: Sequence[bytes]) -> Longs:
    try:
        return wholes(words)
    except (ValueError, OverflowError):
        raise wrong(place, f"whole numbers of up to 63 bits, not {_culprit(words, wholes)}") from None


def _culprit(words: Sequence[bytes], column: Callable[[Sequence[bytes]], object]) -> str:
    """Return the first invalid word, for a message."""
    for word in words:
        try:
            column([word])
        except (ValueError, OverflowError):
            return repr(word[:40].decode("utf-8", errors="replace"))
    raise AssertionError("one of the words is not a number")
