"""The lens in a photo's metadata: EXIF in JPEG, TIFF and PNG.

CIPA DC-008, "Exchangeable image file format for digital still cameras: Exif Version 2.32", 2019.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

from ..base.regular_file import open_regular
from ..camera.focal_length import from_equivalent, is_plausible

LARGEST = 2**20
"""Bytes from the beginning that are looked at; the pixels come after."""
EXIF_IFD, WIDTH, HEIGHT = 0x8769, 0xA002, 0xA003
FOCAL_MM, EQUIVALENT, RESOLUTION, RESOLUTION_UNIT = 0x920A, 0xA405, 0xA20E, 0xA210
"""Tags of Exif 2.32."""
MILLIMETRES = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""Millimetres of the units of resolution; the default is inches."""
SENSORS = (1.0, 70.0)
"""Millimetres of the long side of sensors that there are, from endoscopes' to medium format's."""
ASPECT = 0.01
"""Relative difference of the shapes of a picture above which it was cropped: reducing rounds sides."""
_FORMATS = {1: "B", 3: "H", 4: "I", 5: "II", 9: "i", 10: "ii"}
"""Formats of the types of values; texts and other types are not used."""


@dataclass(frozen=True)
class PhotoData:
    """The lens data of a photo; None for missing values."""

    width: int | None = None
    height: int | None = None
    """Pixels of the original photo; reducing it leaves them unchanged."""
    focal_mm: float | None = None
    equivalent: float | None = None
    """Millimetres, of a 35 mm camera with the same angle of view."""
    resolution: float | None = None
    """Pixels a millimetre of the sensor, across, of the photo as it was taken."""

    def was_cropped(self, width: int, height: int) -> bool:
        """Return whether a file of this size is a crop of the photo; a turn by 90 degrees is not."""
        if not (self.width and self.height):
            return False
        own, long_side = max(width, height) / min(width, height), max(self.width, self.height)
        return abs(own * min(self.width, self.height) / long_side - 1) > ASPECT

    def focal(self, width: int, height: int) -> float | None:
        """Return the focal length in pixels of a file of this size; None if unknown or contradictory."""
        if self.was_cropped(width, height):
            return None
        found = None
        if self.equivalent:
            found = from_equivalent(self.equivalent, width, height)
        elif self.focal_mm and self.resolution and self.width and self.height:
            long = max(self.width, self.height)
            if SENSORS[0] <= long / self.resolution <= SENSORS[1]:
                found = self.focal_mm * self.resolution * max(width, height) / long
        return found if found is not None and is_plausible(found, width, height) else None


def photo_data(path: Path) -> PhotoData | None:
    """Return the lens data of a photo's file; None if EXIF is missing or damaged."""
    try:
        with open_regular(path) as file:
            data = file.read(LARGEST)
        block = _block(data)
        return _photo_data(block) if block else None
    except (OSError, struct.error, ValueError):
        return None


def _block(data: bytes) -> bytes:
    """The TIFF structure in a file's beginning; empty where there is none."""
    if data[:4] in (b"II*\0", b"MM\0*"):
        return data
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        place = 8
        while place + 8 <= len(data):
            size, kind = struct.unpack_from(">I4s", data, place)
            if kind == b"eXIf":
                return data[place + 8 : place + 8 + size]
            place += 12 + size
    place = 2
    while data[:2] == b"\xff\xd8" and place + 4 <= len(data) and data[place] == 0xFF:
        marker, size = data[place + 1], struct.unpack_from(">H", data, place + 2)[0]
        if marker == 0xE1 and data[place + 4 : place + 10] == b"Exif\0\0":
            return data[place + 10 : place + 2 + size]
        if marker == 0xDA:  # the pixels
            break
        place += 2 + size
    return b""


def _photo_data(block: bytes) -> PhotoData:
    order = {b"II": "<", b"MM": ">"}.get(block[:2])
    if order is None:
        raise ValueError("no byte order")
    first = _entries(block, order, struct.unpack_from(f"{order}I", block, 4)[0])
    tags = _entries(block, order, int(first[EXIF_IFD])) if EXIF_IFD in first else first
    resolution = tags.get(RESOLUTION)
    unit = MILLIMETRES.get(int(tags.get(RESOLUTION_UNIT, 2)))
    return PhotoData(
        int(tags.get(WIDTH, 0)) or None, int(tags.get(HEIGHT, 0)) or None,
        tags.get(FOCAL_MM) or None, tags.get(EQUIVALENT) or None,
        resolution / unit if resolution and unit else None,
    )  # fmt: skip


def _entries(block: bytes, order: str, place: int) -> dict[int, float]:
    """The first number of each of a directory's entries that has one, by tag; a fraction over 0 is none."""
    found = {}
    for number in range(struct.unpack_from(f"{order}H", block, place)[0]):
        at = place + 2 + 12 * number
        tag, kind, count = struct.unpack_from(f"{order}HHI", block, at)
        if kind not in _FORMATS or not count:
            continue
        parts = order + _FORMATS[kind]
        where = at + 8
        if count * struct.calcsize(parts) > 4:
            where = struct.unpack_from(f"{order}I", block, where)[0]
        value = struct.unpack_from(parts, block, where)
        if len(value) == 1 or value[1]:
            found[tag] = value[0] / (value[1] if len(value) > 1 else 1)
    return found
