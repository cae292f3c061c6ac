"""Bundler's bundle.out with its list.txt, file versions 0.1 to 0.4 and without a header.

P = R X + t, p = -P.xy / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p from the picture's centre, y up, the
camera looking down -z (Snavely, Bundler v0.4 User's Manual). What the manual leaves out is as Bundler's own
readers have it: before 0.3 the scene is mirrored in z and no feature positions are stored, before 0.2 there
is no distortion, and 0.4 may name its pictures.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.counting import counted
from ..base.errors import UserError
from ..base.regular_file import open_regular
from ..camera.reconstruction import Image, Intrinsics
from .building import (
    Observations,
    assemble,
    check_size,
    observations_of,
    picture_size,
    rotation_from,
    visible,
)
from .imported_model import ImportedModel
from .parsing import Numbers, Text

FORMAT = "Bundler"
TURNED = np.diag([1.0, -1.0, -1.0])
"""From a camera that looks down -z with y up to ours."""
MIRRORED = np.diag([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Layout:
    """How many numbers a file of some version has where."""

    version: str
    camera: int = 15
    """Numbers of a camera."""
    before: int = 0
    """Numbers before a point's position."""
    view: int = 4
    """Numbers of a view: camera, key and, where stored, x and y."""

    @property
    def is_mirrored(self) -> bool:
        """Whether the model is mirrored in z, as before version 0.3."""
        return self.version < "0.3"


LAYOUTS = {
    "0.3": Layout("0.3"),
    "0.2": Layout("0.2", view=2),
    "0.1": Layout("0.1", camera=13, view=2),
    "0.4": Layout("0.4"),
}


def recognises(path: Path) -> bool:
    """Whether a file is a bundle file, by its suffix or first line; False where it cannot be read."""
    try:
        with open_regular(path) as file:
            start = file.read(200).removeprefix(b"\xef\xbb\xbf").lstrip()
    except OSError:
        return False
    return path.suffix.lower() == ".out" or re.match(rb"# Bundle file|v0\.\d\s", start) is not None


def read(path: Path, size: tuple[int, int]) -> ImportedModel:
    """Read a bundle file and the list of pictures beside it.

    `size` is the clip's (width, height), used unless a listed picture lies beside the file, because the
    format has none. Raises UserError naming the line that is not what was expected.
    """
    text = Text(path)
    version = _version(text)
    stream = _stream(text, version)
    names, layout, values = stream.names, stream.layout, stream.numbers.values
    notes: list[str] = []
    if not names:
        names, listed = _listed(path, stream.cameras)
        notes += listed
    size = picture_size(path.parent, [name for name in names if name]) or size
    lenses, images = _cameras(stream, size)
    if not images:
        raise UserError(f"{path} has no registered camera; solve the clip again")
    columns = stream.starts[:, None] + np.arange(3)
    xyz, rgb = values[columns], values[columns + 3]
    if layout.is_mirrored:
        xyz = xyz @ MIRRORED
    views, lost = observations_of(stream.numbers, stream.starts, layout.view, stream.cameras, images)
    notes += lost
    if layout.view == 4:
        views = replace(views, xy=views.xy * [1.0, -1.0] + np.array(size) / 2)
        notes += check_size(path, size, views.xy)
    else:
        views = _projected(lenses, images, xyz, views)
        notes.append("this version stores no feature positions: each point is taken to be where it projects")
    reconstruction = assemble(lenses, images, views, xyz, rgb)
    label = f"{FORMAT} v{version}" if version else f"{FORMAT} without a header"
    return ImportedModel(label, reconstruction, tuple(names), tuple(notes), layout.view != 4)


def _version(text: Text) -> str:
    """The version that the header names; empty where there is none."""
    first = text.demand("a header or the numbers of cameras and points")
    found = re.fullmatch(r"(?:# Bundle file )?v(\d+\.\d+)", first)
    if found and found[1] in LAYOUTS:
        return found[1]
    if found or not re.match(r"[\d+-]", first):
        raise text.wrong(f"'# Bundle file v0.3' or another version of {', '.join(sorted(LAYOUTS))}")
    text.back()
    return ""


@dataclass(frozen=True)
class _Stream:
    """The numbers of a file: first its cameras, then its points."""

    numbers: Numbers
    layout: Layout
    cameras: int
    starts: NDArray[np.int64]
    """(points,) index of each point's position."""
    names: list[str]
    """Names of the pictures; empty if the file has none."""


def _stream(text: Text, version: str) -> _Stream:
    words = text.demand("the numbers of cameras and points").split()
    if version == "0.4" and len(words) == 3:
        return _named(text, words)
    if len(words) != 2:
        raise text.wrong("two numbers, of cameras and of points")
    cameras = text.count(words[0], "cameras", 26)
    points = text.count(words[1], "points", 14)
    numbers = text.numbers()
    candidates = [version] if version else ["0.3", "0.2", "0.1"]
    problem = None
    for layout in map(LAYOUTS.__getitem__, candidates):
        try:
            return _Stream(numbers, layout, cameras, _starts(numbers, layout, cameras, points), [])
        except UserError as error:
            # Without a header, the expectation of the common version is the most helpful.
            problem = problem or error
    assert problem is not None
    raise problem


def _named(text: Text, words: list[str]) -> _Stream:
    """Version 0.4 as Bundler's own readers know it: named pictures, and an ID before each point."""
    cameras = text.count(words[0], "cameras", 36)
    points = text.count(words[1], "points", 16)
    if words[2] != "0":
        raise text.wrong("0 as the third number: files that hold feature descriptors are not read")
    names: list[str] = []
    parts: list[Numbers] = []
    for _ in range(cameras):
        row = text.demand("a picture's name, width, height, focal length and ID").rsplit(maxsplit=4)
        if len(row) != 5:
            raise text.wrong("a picture's name, width, height, focal length and ID")
        names.append(row[0])
        parts.append(text.numbers(5))
        if len(parts[-1].values) != 15:
            raise text.wrong("the last of five lines with f k1 k2, a rotation and a translation")
    parts.append(text.numbers())
    # One stream again, as in the other versions.
    numbers = Numbers(
        text,
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.ends + 15 * index for index, part in enumerate(parts)]),
        np.concatenate([part.lines for part in parts]),
    )
    layout = Layout("0.4", before=1)
    return _Stream(numbers, layout, cameras, _starts(numbers, layout, cameras, points), names)


def _starts(numbers: Numbers, layout: Layout, cameras: int, points: int) -> NDArray[np.int64]:
    """(points,) index of each point's position; UserError unless the file ends with the last point."""
    # A view list has its own length, so a point is found only from the one before it.
    stream, end = memoryview(numbers.values), len(numbers.values)
    at = cameras * layout.camera
    least = 7 + layout.before
    starts = np.empty(min(points, max(end - at, 0) // least), dtype=np.int64)
    for row in range(points):
        count_at = at + least - 1
        if count_at >= end:
            raise numbers.wrong(end, f"{points - row} more points of {points}")
        count = stream[count_at]
        if count < 0 or count % 1:
            raise numbers.wrong(count_at, f"the number of views of point {row}")
        starts[row] = at + layout.before
        at += least + layout.view * int(count)
        if at > end:
            raise numbers.wrong(end, f"{count:g} views of point {row}")
    if at != end:
        raise numbers.wrong(at, f"nothing after {points} points")
    return starts


def _cameras(stream: _Stream, size: tuple[int, int]) -> tuple[list[Intrinsics], list[Image]]:
    numbers, layout = stream.numbers, stream.layout
    width, height = size
    none, nowhere = np.zeros((0, 2)), np.zeros(0, dtype=np.int32)
    lenses: list[Intrinsics] = []
    images: list[Image] = []
    for index in range(stream.cameras):
        first = index * layout.camera
        row = numbers.values[first : first + layout.camera]
        focal, pose = float(row[0]), row[-12:]
        k1, k2 = (float(row[1]), float(row[2])) if layout.camera == 15 else (0.0, 0.0)
        if focal == 0:
            continue
        if focal < 0:
            raise numbers.wrong(first, f"the focal length of camera {index}, greater than zero")
        line = numbers.line(first + layout.camera - 12)
        problem = numbers.text.wrong(f"the first of three lines with a rotation of camera {index}", line)
        rotation = rotation_from(pose[:9].reshape(3, 3), problem)
        translation = pose[9:]
        if layout.is_mirrored:
            rotation, translation = MIRRORED @ rotation @ MIRRORED, MIRRORED @ translation
        images.append(Image(index, TURNED @ rotation, TURNED @ translation, none, nowhere, len(lenses)))
        lenses.append(Intrinsics(width, height, focal, focal, width / 2, height / 2, k1, k2))
    return lenses, images


def _projected(
    lenses: list[Intrinsics], images: list[Image], xyz: Floats, views: Observations
) -> Observations:
    """The views, moved to the places where the points project; none that are behind or outside."""
    xy = np.full((len(views.image), 2), np.nan)
    for image in images:
        rows = np.flatnonzero(views.image == image.frame)
        place, inside = visible(lenses[image.camera], image, xyz[views.point[rows]])
        xy[rows[inside]] = place[inside]
    seen = np.isfinite(xy[:, 0])
    return Observations(views.image[seen], views.point[seen], xy[seen])


def _listed(path: Path, cameras: int) -> tuple[list[str], list[str]]:
    """The names in the list of pictures beside the file, and notes; empty names where there is no list."""
    stem = path.stem.removesuffix(".bundle")
    for name in ("list.txt", f"{stem}.list.txt", f"{path.name}.list.txt"):
        file = path.with_name(name)
        if file.is_file():
            return _names(file, path, cameras), []
    # Bundler itself writes into a separate folder and leaves the list where it was started.
    file = path.parent.parent / "list.txt"
    if path.parent.name == "bundle" and file.is_file():
        return _names(file, path, cameras), []
    return [""] * cameras, ["there is no list.txt beside the file, so it names no pictures"]


def _names(file: Path, bundle: Path, cameras: int) -> list[str]:
    text = Text(file)
    names = []
    while (row := text.next()) is not None:
        # A name, and behind it a 0 and a focal length in pixels where the picture's EXIF has one.
        names.append(re.sub(r"\s+0\s+[-+.\deE]+$", "", row))
    if len(names) != cameras:
        raise UserError(
            f"{file} names {counted(len(names), 'picture')}, {bundle.name} has {counted(cameras, 'camera')};"
            " both must be of the same solve"
        )
    return names
