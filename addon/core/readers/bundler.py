"""Bundler's bundle.out with its list.txt, file version 0.3, which every exporter writes.

P = R X + t, p = -P.xy / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p from the picture's centre, y up, the
camera looking down -z (Snavely, Bundler v0.4 User's Manual).
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.counting import counted
from ..base.errors import UserError
from ..camera.reconstruction import Image, Intrinsics
from .building import assemble, check_size, observations_of, picture_size, rotation_from
from .matching import Imported
from .parsing import Numbers, Text, beginning
from .poses import OPENGL

FORMAT = "Bundler"
HEADER = re.compile(r"(# Bundle file )?v0\.3")
CAMERA, POINT, VIEW = 15, 7, 4
"""Numbers a camera, a point without its views, and a view (camera, key, x, y)."""


def recognises(path: Path) -> bool:
    """Return whether a file is a bundle file, by its suffix or first line."""
    start = beginning(path)
    is_marked = re.match(rb"# Bundle file|v0\.\d\s", start or b"") is not None
    return start is not None and (is_marked or path.suffix.lower() == ".out")


def read(path: Path, size: tuple[int, int]) -> Imported:
    """Read a bundle file; see `Reader.read`. The size of a listed picture beside the file has priority."""
    text = Text(path)
    if HEADER.fullmatch(text.demand("a header")) is None:
        raise text.wrong("'# Bundle file v0.3'; export it again with another program, or as a COLMAP model")
    words = text.demand("the numbers of cameras and points").split()
    if len(words) != 2:
        raise text.wrong("two numbers, of cameras and of points")
    count = text.count(words[0], "cameras", 26)
    points = text.count(words[1], "points", 14)
    numbers = text.numbers()
    starts = _starts(numbers, count, points)
    names, notes = _listed(path, count)
    size = picture_size(path.parent, [name for name in names if name]) or size
    lenses, images = _cameras(numbers, count, size)
    if not images:
        raise UserError(f"{path} has no registered camera; solve the clip again")
    columns = starts[:, None] + np.arange(3)
    views, lost = observations_of(numbers, starts, count, images)
    views = replace(views, xy=views.xy * [1.0, -1.0] + np.array(size) / 2)
    notes += [*lost, *check_size(path, size, views.xy)]
    reconstruction = assemble(lenses, images, views, numbers.values[columns], numbers.values[columns + 3])
    return Imported(reconstruction, f"{FORMAT} v0.3", tuple(notes), tuple(names))


def _starts(numbers: Numbers, cameras: int, points: int) -> NDArray[np.int64]:
    """Return the (points,) indices of positions; raises UserError unless the file ends with a point."""
    # Lists of views differ in length, so each point is found from the previous one.
    stream, end = memoryview(numbers.values), len(numbers.values)
    at = cameras * CAMERA
    starts = np.empty(min(points, max(end - at, 0) // POINT), dtype=np.int64)
    for row in range(points):
        count_at = at + POINT - 1
        if count_at >= end:
            raise numbers.wrong(end, f"{points - row} more points of {points}")
        count = stream[count_at]
        if count < 0 or count % 1:
            raise numbers.wrong(count_at, f"the number of views of point {row}")
        starts[row] = at
        at += POINT + VIEW * int(count)
        if at > end:
            raise numbers.wrong(end, f"{count:g} views of point {row}")
    if at != end:
        raise numbers.wrong(at, f"nothing after {points} points")
    return starts


def _cameras(numbers: Numbers, count: int, size: tuple[int, int]) -> tuple[list[Intrinsics], list[Image]]:
    width, height = size
    lenses: list[Intrinsics] = []
    images: list[Image] = []
    for index in range(count):
        first = index * CAMERA
        focal, k1, k2, *pose = numbers.values[first : first + CAMERA].tolist()
        if focal == 0:
            continue
        if focal < 0:
            raise numbers.wrong(first, f"the focal length of camera {index}, greater than zero")
        line = numbers.line(first + 3)
        problem = numbers.text.wrong(f"the first of three lines with a rotation of camera {index}", line)
        rotation = OPENGL @ rotation_from(np.reshape(pose[:9], (3, 3)), problem)
        images.append(Image(index, rotation, OPENGL @ pose[9:], camera=len(lenses)))
        lenses.append(Intrinsics(width, height, focal, focal, width / 2, height / 2, k1, k2))
    return lenses, images


def _listed(path: Path, cameras: int) -> tuple[list[str], list[str]]:
    stem = path.stem.removesuffix(".bundle")
    for name in ("list.txt", f"{stem}.list.txt", f"{path.name}.list.txt"):
        file = path.with_name(name)
        if file.is_file():
            return _names(file, path, cameras), []
    # Bundler writes into a folder that it makes, and leaves the list in its working folder.
    file = path.parent.parent / "list.txt"
    if path.parent.name == "bundle" and file.is_file():
        return _names(file, path, cameras), []
    return [""] * cameras, ["there is no list.txt beside the file, so it names no pictures"]


def _names(file: Path, bundle: Path, cameras: int) -> list[str]:
    text = Text(file)
    names = []
    while (row := text.next()) is not None:
        # A name, maybe followed by a 0 and the focal length in pixels from EXIF.
        names.append(re.sub(r"\s+0\s+[-+.\deE]+$", "", row))
    if len(names) != cameras:
        raise UserError(
            f"{file} names {counted(len(names), 'picture')}, {bundle.name} has {counted(cameras, 'camera')};"
            " export both again, of one solve"
        )
    return names
