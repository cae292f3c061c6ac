"""COLMAP's text files: one line a camera or point, two an image, comments after `#`."""

import re
from collections.abc import Iterator
from itertools import compress
from pathlib import Path

import numpy as np

from ..base.arrays import Floats
from ..base.numbers import LARGEST
from ..camera.reconstruction import Intrinsics, Points
from .colmap_tables import MISSING, NO_POINT, ImageRow, Longs, PointTable, Tables
from .parsing import START, Text, contents, plain, wrong
from .poses import lens

FILES = ("cameras.txt", "images.txt", "points3D.txt")
PROMISE = re.compile(rb"^# Number of \w+: (\d{1,15})\b", re.MULTILINE)
COLUMNS = 8
"""Numbers of a point before its track."""


def read(folder: Path) -> Tables:
    """Read the model in a folder; raises UserError with file and line."""
    files = cameras, images, points = [folder / name for name in FILES]
    return Tables(files, _cameras(cameras), _images(images), _points(points))


def _text(path: Path) -> bytes:
    data = plain(contents(path, MISSING.format(*FILES)))
    at = data.find(b"\0")
    if at >= 0:
        raise wrong(
            f"{path}, byte {at}", f"text, not binary data; name it {path.stem}.bin, or save UTF-16 as UTF-8"
        )
    return data


def _rows(text: Text) -> Iterator[str]:
    return (row for row in iter(text.next, None) if not row.startswith("#"))


def _check_count(path: Path, data: bytes, what: str, count: int) -> None:
    """Raise UserError if a count differs from COLMAP's header: the only sign of a truncated text."""
    found = PROMISE.search(data[:START])
    if found and int(found[1]) != count:
        place = f"{path}, line {data[: found.end()].count(b'\n') + 1}"
        promised = f"{int(found[1])} {what} as in its header"
        raise wrong(place, f"{promised}, but {count} follow; delete it if that is meant")


def _cameras(path: Path) -> dict[int, Intrinsics]:
    data = _text(path)
    text = Text(path, data)
    cameras: dict[int, Intrinsics] = {}
    for row in _rows(text):
        words = row.split()
        if len(words) < 4:
            raise text.wrong("CAMERA_ID, a camera model, WIDTH, HEIGHT and its parameters")
        key, width, height = _whole(text, [words[0], *words[2:4]]).tolist()
        if key in cameras:
            raise text.wrong(f"a CAMERA_ID that no other camera has, not {key}")
        values = text.row(words[4:]).tolist()
        cameras[key] = lens(f"{path}, line {text.line}", words[1], (width, height), values)
    _check_count(path, data, "cameras", len(cameras))
    return cameras


def _images(path: Path) -> list[ImageRow]:
    data = _text(path)
    text = Text(path, data)
    images: list[ImageRow] = []
    for row in _rows(text):
        place, words = f"{path}, line {text.line}", row.split(maxsplit=9)
        if len(words) < 10:
            raise text.wrong("IMAGE_ID, a quaternion, a translation, CAMERA_ID and a name")
        key, camera = _whole(text, [words[0], words[8]]).tolist()
        pose = text.row(words[1:8])
        # The line of features follows directly; it may be empty, or missing at the end.
        xy, points = _features(text, text.following().split())
        features = f"{path}, line {text.line}"
        images.append(ImageRow(place, key, pose[:4], pose[4:], camera, words[9], features, xy, points))
    _check_count(path, data, "images", len(images))
    return images


def _features(text: Text, words: list[str]) -> tuple[Floats, Longs]:
    """Return positions (n, 2) and keys (n,) of the features with a point."""
    if len(words) % 3:
        raise text.wrong("features as X Y POINT3D_ID")
    points = _whole(text, words[2::3])
    seen = points != NO_POINT
    # Most features have none, and parsing takes time.
    x, y = (text.row(list(compress(words[first::3], seen))) for first in (0, 1))
    return np.stack([x, y], axis=1), points[seen]


def _points(path: Path) -> PointTable:
    data = _text(path)
    # Without the tracks, which may be most of the file; the images hold the same observations.
    rows = (line.split(None, COLUMNS)[:COLUMNS] for line in data.split(b"\n"))
    text = Text(path, b"\n".join(b" ".join(row) if row and row[0][:1] != b"#" else b"" for row in rows))
    numbers = text.numbers()
    counts = np.diff(numbers.ends, prepend=0)
    lines, starts = numbers.lines[counts > 0], (numbers.ends - counts)[counts > 0]
    short = np.flatnonzero(counts[counts > 0] < COLUMNS)
    if len(short):
        raise text.wrong("POINT3D_ID, X, Y, Z, R, G, B, ERROR and a track", int(lines[short[0]]))
    _check_count(path, data, "points", len(starts))
    keys = numbers.whole(starts, int(LARGEST), "a POINT3D_ID")
    rgb = numbers.whole((starts[:, None] + np.arange(4, 7)).ravel(), 256, "a color")
    xyz, error = numbers.values[starts[:, None] + np.arange(1, 4)], numbers.values[starts + 7]
    points = Points(xyz, rgb.reshape(-1, 3).astype(np.uint8), error)
    return PointTable(keys, points, lambda row: f"{path}, line {lines[row]}")


def _whole(text: Text, words: list[str]) -> Longs:
    """Parse (n,) whole numbers of the last line read."""
    values = text.row(words)
    if np.any(values % 1):
        raise text.wrong(f"whole numbers, not {values[np.argmax(values % 1 > 0)]:g}")
    return values.astype(np.int64)
