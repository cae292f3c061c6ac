"""Tables of a COLMAP model from text or binary files, their check and assembly."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import UserError
from ..base.numbers import LARGEST
from ..camera.reconstruction import Image, Intrinsics, Points, Reconstruction, matrix_from_quaternion
from .parsing import wrong

Longs = NDArray[np.int64]
MISSING = "is missing; a COLMAP model has {0}, {1} and {2}"
"""The error for a file that is not there, with the names of all."""
NO_POINT = -1
"""POINT3D_ID of a feature without a point; the same as 2^64 - 1 in binary files."""


@dataclass(frozen=True)
class ImageRow:
    """An image of a model with the keys of its file."""

    place: str
    """Its place in the file for messages, such as "images.txt, line 5"."""
    key: int
    quaternion: Floats
    """(4,) w, x, y, z of the world-to-camera rotation."""
    translation: Floats
    """(3,) of the world-to-camera pose."""
    camera: int
    name: str
    features_place: str
    xy: Floats
    """(n, 2) features in pixels."""
    points: Longs
    """(n,) keys of their points, or NO_POINT."""


@dataclass(frozen=True)
class PointTable:
    """The m points of a model with the keys of its file."""

    keys: Longs
    """(m,) POINT3D_IDs."""
    points: Points
    place: Callable[[int], str]
    """Returns the place of a row in the file."""


@dataclass(frozen=True)
class Tables:
    """A complete model."""

    files: Sequence[Path]
    """Those of cameras, images and points."""
    cameras: dict[int, Intrinsics]
    images: Sequence[ImageRow]
    points: PointTable


def assemble(tables: Tables) -> tuple[Reconstruction, tuple[str, ...]]:
    """Assemble a model and the names of its images, both in the order of the image keys.

    `Image.frame` is an index into the names. Features without a point are left out. Raises UserError for
    numbers that are not finite, for unknown or repeated keys, and for invalid rotations.
    """
    for path, held in zip(tables.files, (tables.cameras, tables.images), strict=False):
        if not held:
            raise UserError(f"{path} has no {path.stem}; export the model again, or take one that has")
    table = tables.points
    usable = _usable(table.points.xyz).all(axis=1) & _usable(table.points.error)
    if not usable.all():
        raise wrong(table.place(int(np.argmin(usable))), f"a point of numbers up to {LARGEST:g}")
    order = np.argsort(table.keys, kind="stable")
    keys = table.keys[order]
    twice = np.flatnonzero(keys[1:] == keys[:-1])
    if len(twice):
        again = int(order[twice[0] + 1])
        raise wrong(table.place(again), f"a POINT3D_ID that no other point has, not {table.keys[again]}")
    cameras = sorted(tables.cameras)
    index = {key: i for i, key in enumerate(cameras)}
    images: list[Image] = []
    rows = sorted(tables.images, key=lambda row: row.key)
    for frame, row in enumerate(rows):
        if frame and rows[frame - 1].key == row.key:
            raise wrong(row.place, f"an IMAGE_ID that no other image has, not {row.key}")
        if row.camera not in index:
            raise wrong(row.place, f"one of the model's cameras, not {row.camera}")
        xy, points = _features(row, keys, order, tables.files[2])
        images.append(Image(frame, _rotation(row), row.translation, xy, points, index[row.camera]))
    lenses = tuple(tables.cameras[key] for key in cameras)
    return Reconstruction(lenses, tuple(images), table.points), tuple(row.name for row in rows)


def _usable(values: Floats) -> NDArray[np.bool_]:
    """Mark finite numbers up to `LARGEST`; NaN compares false."""
    return np.asarray(np.abs(values) <= LARGEST)


def _rotation(row: ImageRow) -> Floats:
    if not (_usable(row.quaternion).all() and _usable(row.translation).all()):
        raise wrong(row.place, f"a pose of numbers up to {LARGEST:g}")
    if not np.abs(row.quaternion).max() > 1e-9:
        raise wrong(row.place, "a quaternion that is not zero")
    return matrix_from_quaternion(row.quaternion)


def _features(row: ImageRow, keys: Longs, order: Longs, file: Path) -> tuple[Floats, NDArray[np.int32]]:
    """Return positions (n, 2) and rows (n,) of an image's points, from the sorted keys and their rows."""
    seen = row.points != NO_POINT
    wanted, xy = row.points[seen], row.xy[seen]
    at = np.searchsorted(keys, wanted)
    known = at < len(keys)
    known[known] = keys[at[known]] == wanted[known]
    if not known.all():
        why = f"{file} has {len(keys)} points: export the model again, with all of them"
        raise wrong(row.features_place, f"one of the model's points, not {wanted[np.argmin(known)]}; {why}")
    if not _usable(xy).all():
        raise wrong(row.features_place, f"features at places up to {LARGEST:g}")
    return xy, order[at].astype(np.int32)
