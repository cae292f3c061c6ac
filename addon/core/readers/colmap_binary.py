"""COLMAP's binary files: little-endian, without padding, each count before its items."""

import struct
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..camera.distortion import PARAMETERS
from ..camera.reconstruction import Intrinsics, Points
from .colmap_tables import MISSING, ImageRow, PointTable, Tables
from .parsing import contents, decoded, wrong
from .poses import lens

FILES = ("cameras.bin", "images.bin", "points3D.bin")
MODELS = tuple(PARAMETERS)
COUNT = struct.Struct("<Q")
CAMERA = struct.Struct("<IiQQ")
POSE = struct.Struct("<I7dI")
FEATURE = np.dtype([("xy", "<f8", 2), ("point", "<i8")])
POINT = np.dtype([("key", "<i8"), ("xyz", "<f8", 3), ("rgb", "u1", 3), ("error", "<f8")])
SIGHTING = 8
"""Bytes of an entry of a point's track."""


class Cursor:
    """A position in a file's bytes, which advances by reading and never passes the end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.data = contents(path, MISSING.format(*FILES))
        self.at = 0
        head = self.data[:64]
        if len(head) > 8 and all(32 <= byte < 127 or byte in b"\t\r\n" for byte in head):
            raise wrong(f"{path}, byte 0", f"binary data, not text; name it {path.stem}.txt")

    def place(self, at: int | None = None) -> str:
        """Return the file and a byte, by default the next, for errors."""
        return f"{self.path}, byte {self.at if at is None else at}"

    def take(self, layout: struct.Struct, what: str) -> tuple[int | float, ...]:
        """Read the next values; raises UserError at the end of the file."""
        if len(self.data) - self.at < layout.size:
            raise wrong(self.place(), f"{what}, but the file ends")
        values = layout.unpack_from(self.data, self.at)
        self.at += layout.size
        return values

    def count(self, least: int, what: str) -> int:
        """Read a count of items of at least `least` bytes; raises UserError if they do not fit the file."""
        place = self.place()
        number = int(self.take(COUNT, f"the number of {what}")[0])
        left = len(self.data) - self.at
        if number * least > left:
            raise wrong(place, f"at most {left // least} {what} in the {left} bytes left, not {number}")
        return number

    def finish(self) -> None:
        if self.at != len(self.data):
            raise wrong(self.place(), f"the file's end, not {len(self.data) - self.at} bytes more")


def read(folder: Path) -> Tables:
    """Read the model in a folder; raises UserError with file and byte."""
    files = cameras, images, points = [folder / name for name in FILES]
    return Tables(files, _cameras(cameras), _images(images), _points(points))


def _cameras(path: Path) -> dict[int, Intrinsics]:
    cursor = Cursor(path)
    cameras: dict[int, Intrinsics] = {}
    fewest = min(len(names) for names in PARAMETERS.values())
    for _ in range(cursor.count(CAMERA.size + 8 * fewest, "cameras")):
        place = cursor.place()
        key, model, width, height = (int(value) for value in cursor.take(CAMERA, "a camera"))
        if not 0 <= model < len(MODELS):
            raise wrong(place, f"the number of a camera model, 0 to {len(MODELS) - 1}, not {model}")
        if key in cameras:
            raise wrong(place, f"a CAMERA_ID that no other camera has, not {key}")
        name = MODELS[model]
        layout = struct.Struct(f"<{len(PARAMETERS[name])}d")
        cameras[key] = lens(place, name, (width, height), cursor.take(layout, f"the parameters of {name}"))
    cursor.finish()
    return cameras


def _images(path: Path) -> list[ImageRow]:
    cursor = Cursor(path)
    images: list[ImageRow] = []
    for _ in range(cursor.count(POSE.size + 1 + COUNT.size, "images")):
        place = cursor.place()
        key, *pose, camera = cursor.take(POSE, "an image")
        end = cursor.data.find(b"\0", cursor.at)
        if end < 0:
            raise wrong(cursor.place(), "an image's name that ends in a zero byte")
        name = decoded(cursor.data[cursor.at : end]).strip()
        if not name:
            raise wrong(cursor.place(), "an image with a name")
        cursor.at = end + 1
        features = cursor.place()
        count = cursor.count(FEATURE.itemsize, "features")
        rows = np.frombuffer(cursor.data, FEATURE, count, cursor.at)
        # Most features have no point, and views would keep the file in memory.
        rows = rows[rows["point"] != -1]
        cursor.at += count * FEATURE.itemsize
        images.append(
            ImageRow(
                place, int(key), np.array(pose[:4]), np.array(pose[4:]), int(camera), name,
                features, rows["xy"].astype(np.float64), rows["point"].astype(np.int64),
            )
        )  # fmt: skip
    cursor.finish()
    return images


def _points(path: Path) -> PointTable:
    cursor = Cursor(path)
    starts = _starts(cursor, cursor.count(POINT.itemsize + COUNT.size, "points"))
    cursor.finish()
    if not len(starts):
        rows = np.zeros(0, POINT)
    else:
        windows = sliding_window_view(np.frombuffer(cursor.data, np.uint8), POINT.itemsize)
        rows = windows[starts].view(POINT)[:, 0]
    points = Points(
        np.ascontiguousarray(rows["xyz"], dtype=np.float64),
        np.ascontiguousarray(rows["rgb"]),
        np.ascontiguousarray(rows["error"], dtype=np.float64),
    )
    return PointTable(rows["key"].astype(np.int64), points, lambda row: f"{path}, byte {starts[row]}")


def _starts(cursor: Cursor, count: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the (count,) byte offsets of points, whose tracks differ in length."""
    data, at, end = cursor.data, cursor.at, len(cursor.data)
    unpack, size, fixed = COUNT.unpack_from, POINT.itemsize, POINT.itemsize + COUNT.size
    starts = []
    for _ in range(count):
        if at + fixed > end:
            raise wrong(cursor.place(min(at, end)), "a point, but the file ends")
        starts.append(at)
        at += fixed + SIGHTING * unpack(data, at + size)[0]
    if at > end:
        raise wrong(cursor.place(starts[-1] + size), "a track that the file has room for")
    cursor.at = at
    return np.array(starts, dtype=np.int64)
