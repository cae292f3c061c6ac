"""The focal length that a photo's file tells, believed only as far as the picture agrees."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.media.clip import open_footage
from addon.core.sfm.worker import _metadata_focal

SIZE = (768, 576)
TAKEN = (3072, 2304)
FOCAL_MM, SENSOR_MM = 6.3, 7.2
FOCAL = FOCAL_MM / SENSOR_MM * SIZE[0]
"""Pixels of the file."""


def exif(order: str = "<", **fields: float) -> bytes:
    """A TIFF structure whose EXIF directory holds these tags."""
    tags = {
        "focal_mm": (0x920A, 5), "width": (0xA002, 4), "height": (0xA003, 4), "resolution": (0xA20E, 5),
        "unit": (0xA210, 3), "equivalent": (0xA405, 3),
    }  # fmt: skip
    start, entries, values = 26, b"", b""
    after = start + 2 + 12 * len(fields) + 4
    for name, value in sorted(fields.items(), key=lambda item: tags[item[0]]):
        tag, kind = tags[name]
        if kind == 5:
            content = struct.pack(f"{order}I", after + len(values))
            values += struct.pack(f"{order}II", round(value * 10_000), 10_000)
        else:
            content = struct.pack(f"{order}{'H' if kind == 3 else 'I'}", int(value)).ljust(4, b"\0")
        entries += struct.pack(f"{order}HHI", tag, kind, 1) + content
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8)
    first = struct.pack(f"{order}HHHII", 1, 0x8769, 4, 1, start) + bytes(4)
    return head + first + struct.pack(f"{order}H", len(fields)) + entries + bytes(4) + values


def photo(folder: Path, block: bytes, size: tuple[int, int] = SIZE, suffix: str = ".jpg") -> Path:
    """A folder of two photos with such EXIF."""
    folder.mkdir(exist_ok=True)
    data = cv2.imencode(suffix, np.full((size[1], size[0], 3), 128, np.uint8))[1].tobytes()
    if suffix == ".jpg":
        segment = b"Exif\0\0" + block
        data = data[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[2:]
    elif block:
        chunk = struct.pack(">I", len(block)) + b"eXIf" + block
        data = data[:33] + chunk + struct.pack(">I", 0) + data[33:]
    for number in (1, 2):
        (folder / f"p_{number}{suffix}").write_bytes(data)
    return folder


def focal_of(folder: Path) -> float | None:
    return _metadata_focal(open_footage(folder))


RESOLUTION = TAKEN[0] / SENSOR_MM * 25.4
FULL = {"focal_mm": FOCAL_MM, "width": TAKEN[0], "height": TAKEN[1], "resolution": RESOLUTION, "unit": 2}


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_reduced_photo_has_a_reduced_focal_length(tmp_path: Path, order: str) -> None:
    # It was four times as long.
    assert focal_of(photo(tmp_path / "p", exif(order, **FULL))) == pytest.approx(FOCAL, rel=1e-3)


def test_a_photo_as_it_was_taken(tmp_path: Path) -> None:
    size = (TAKEN[0] // 8, TAKEN[1] // 8)
    block = exif(**FULL | {"width": size[0], "height": size[1], "resolution": RESOLUTION / 8})
    found = focal_of(photo(tmp_path / "p", block, size))
    assert found == pytest.approx(FOCAL_MM / SENSOR_MM * size[0], rel=1e-3)


@pytest.mark.parametrize(
    ("more", "size"),
    [
        ({}, (768, 432)),  # cropped to 16:9
        ({"equivalent": 35}, (768, 432)),
        ({"focal_mm": 900.0}, SIZE),  # sees half a degree
        ({"focal_mm": 0.3}, SIZE),
        ({"resolution": 72}, SIZE),  # a sensor a metre wide: a printer's resolution
        ({"width": 0}, SIZE),  # nothing says of which size the resolution is
    ],
    ids=["cropped", "cropped equivalent", "too long", "too short", "no sensor", "no size"],
)
def test_what_contradicts_the_picture_is_not_believed(
    tmp_path: Path, more: dict[str, float], size: tuple[int, int]
) -> None:
    assert focal_of(photo(tmp_path / "p", exif(**FULL | more), size)) is None


def test_without_or_damaged_it_tells_nothing(tmp_path: Path) -> None:
    assert focal_of(photo(tmp_path / "a", b"", suffix=".png")) is None
    block = exif(**FULL)
    for number, cut in enumerate(range(0, len(block), 3)):
        # Whatever is cut off: no error, and never a length that is wrong.
        found = focal_of(photo(tmp_path / f"c{number}", block[:cut]))
        assert found is None or found == pytest.approx(FOCAL, rel=1e-3)
    loose = b"II*\0" + struct.pack("<I", 0xFFFFFF00)
    assert focal_of(photo(tmp_path / "b", loose)) is None
