"""Reading and writing a reconstruction as a COLMAP text model, exact to the last bit.

A point's row is its POINT3D_ID, an image's name ends in its frame number. Our own parser, because
COLMAP's loads NaN and zero quaternions silently and never says which line is wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .errors import UserError
from .reconstruction import (
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    matrix_from_quaternion,
    quaternion_from_matrix,
)

FILES = ("cameras.txt", "images.txt", "points3D.txt")
PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}


def write_model(folder: Path, reconstruction: Reconstruction) -> None:
    """Write cameras.txt, images.txt and points3D.txt into an existing folder."""
    lines = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    for number, lens in enumerate(reconstruction.cameras, 1):
        model = "OPENCV" if lens.is_distorted else "PINHOLE"
        values = " ".join(repr(float(getattr(lens, name))) for name in PARAMETERS[model])
        lines.append(f"{number} {model} {lens.width} {lens.height} {values}")
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")

    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    seen_by: list[list[str]] = [[] for _ in range(len(reconstruction.points))]
    for number, image in enumerate(reconstruction.images, 1):
        pose = [*quaternion_from_matrix(image.rotation), *image.translation]
        name = f"frame_{image.frame:06d}.png"
        lines.append(f"{number} {' '.join(repr(float(v)) for v in pose)} {image.camera + 1} {name}")
        places = zip(image.xy.tolist(), image.points.tolist(), strict=True)
        lines.append(" ".join(f"{x!r} {y!r} {point}" for (x, y), point in places))
        for row, point in enumerate(image.points.tolist()):
            seen_by[point].append(f"{number} {row}")
    (folder / "images.txt").write_text("\n".join(lines) + "\n")

    points = reconstruction.points
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    rows = zip(points.xyz.tolist(), points.rgb.tolist(), points.error.tolist(), seen_by, strict=True)
    for number, ((x, y, z), (r, g, b), error, track) in enumerate(rows):
        lines.append(f"{number} {x!r} {y!r} {z!r} {r} {g} {b} {error!r} {' '.join(track)}".rstrip())
    (folder / "points3D.txt").write_text("\n".join(lines) + "\n")


def read_model(folder: Path) -> Reconstruction:
    """Read a model; UserError naming file and line where it is not what was expected."""
    cameras = _read_cameras(folder / "cameras.txt")
    points, rows = _read_points(folder / "points3D.txt")
    images = _read_images(folder / "images.txt", {number: i for i, number in enumerate(cameras)}, rows)
    return Reconstruction(tuple(cameras.values()), images, points)


def _read_cameras(path: Path) -> dict[int, Intrinsics]:
    cameras: dict[int, Intrinsics] = {}
    for number, line in _lines(path):
        words = line.split()
        if not words:
            continue
        names = PARAMETERS.get(words[1]) if len(words) > 1 else None
        if names is None:
            raise _wrong(path, number, f"a camera model that is one of {', '.join(PARAMETERS)}")
        values = dict(zip(names, _floats(path, number, words[4:], len(names)), strict=True))
        if "f" in values:
            values["fx"] = values["fy"] = values.pop("f")
        key, width, height = _integers(path, number, [words[0], *words[2:4]])
        if width < 1 or height < 1 or not values["fx"] > 0 or not values["fy"] > 0:
            raise _wrong(path, number, "a size and focal lengths greater than zero")
        cameras[key] = Intrinsics(width, height, **values)
    if not cameras:
        raise UserError(f"{path} has no cameras")
    return cameras


def _read_points(path: Path) -> tuple[Points, dict[int, int]]:
    xyz: list[list[float]] = []
    rgb: list[list[int]] = []
    error: list[float] = []
    rows: dict[int, int] = {}
    for number, line in _lines(path):
        words = line.split()
        if not words:
            continue
        (key,) = _integers(path, number, words[:1])
        values = _floats(path, number, [*words[1:4], *words[7:8]], 4)
        colour = _integers(path, number, words[4:7])
        if not all(0 <= c <= 255 for c in colour):
            raise _wrong(path, number, "colours from 0 to 255")
        rows[key] = len(xyz)
        xyz.append(values[:3])
        rgb.append(colour)
        error.append(values[3])
    shape = np.array(xyz, dtype=np.float64).reshape(-1, 3)
    colours = np.array(rgb, dtype=np.uint8).reshape(-1, 3)
    return Points(shape, colours, np.array(error, dtype=np.float64)), rows


def _read_images(path: Path, cameras: dict[int, int], rows: dict[int, int]) -> tuple[Image, ...]:
    images: dict[int, Image] = {}
    lines = _lines(path)
    for number, line in lines:
        if not line.split():
            continue
        words = line.split(maxsplit=9)
        if len(words) < 10:
            raise _wrong(path, number, "IMAGE_ID, a quaternion, a translation, CAMERA_ID and a name")
        pose = _floats(path, number, words[1:8], 7)
        (camera,) = _integers(path, number, words[8:9])
        quaternion = np.array(pose[:4])
        if not np.linalg.norm(quaternion) > 1e-9:
            raise _wrong(path, number, "a quaternion that is not zero")
        if camera not in cameras:
            raise _wrong(path, number, f"a camera of cameras.txt, not {camera}")
        digits = re.findall(r"\d+", words[9])
        if not digits:
            raise _wrong(path, number, "an image name with a frame number")
        # The line of observations follows at once and may be empty.
        below, text = next(lines, (number + 1, ""))
        values = text.split()
        if len(values) % 3:
            raise _wrong(path, below, "observations as X Y POINT3D_ID")
        xy = np.array(_floats(path, below, [v for i, v in enumerate(values) if i % 3 < 2], None)).reshape(
            -1, 2
        )
        ids = _integers(path, below, values[2::3])
        unknown = [i for i in ids if i != -1 and i not in rows]
        if unknown:
            raise _wrong(path, below, f"points of points3D.txt, not {unknown[0]}")
        known = np.array([i != -1 for i in ids], dtype=bool)
        points = np.array([rows[i] for i in ids if i != -1], dtype=np.int32)
        frame = int(digits[-1])
        images[frame] = Image(
            frame, matrix_from_quaternion(quaternion), np.array(pose[4:]), xy[known], points, cameras[camera]
        )
    return tuple(images[frame] for frame in sorted(images))


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise UserError(f"{path} is missing; a COLMAP text model has {', '.join(FILES)}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path} cannot be read as text: {error}") from None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("#"):
            yield number, line


def _floats(path: Path, line: int, words: list[str], count: int | None) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError:
        raise _wrong(path, line, "numbers") from None
    if count is not None and len(values) != count:
        raise _wrong(path, line, f"{count} numbers, not {len(values)}")
    if not np.all(np.isfinite(values)):
        raise _wrong(path, line, "finite numbers")
    return values


def _integers(path: Path, line: int, words: list[str]) -> list[int]:
    try:
        return [int(word) for word in words]
    except ValueError:
        raise _wrong(path, line, "whole numbers") from None


def _wrong(path: Path, line: int, expected: str) -> UserError:
    return UserError(f"{path}, line {line}: expected {expected}")
