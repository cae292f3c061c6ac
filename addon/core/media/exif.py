"""Metadata of JPEG, TIFF and PNG files: their parts, the directories of EXIF, and the lens of a photo.

CIPA DC-008, "Exchangeable image file format for digital still cameras: Exif Version 2.32", 2019.
"""

import struct
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..base.regular_file import open_regular
from ..camera.focal_length import from_equivalent, is_plausible

LARGEST = 2**20
"""Bytes from the beginning that are looked at; the pixels come after."""
EXIF_IFD, INTEROP_IFD, WIDTH, HEIGHT = 0x8769, 0xA005, 0xA002, 0xA003
ORIENTATION, X_RESOLUTION, Y_RESOLUTION, WHITE, PRIMARIES, PROFILE = 0x112, 0x11A, 0x11B, 0x13E, 0x13F, 0x8773
FOCAL_MM, EQUIVALENT, RESOLUTION, RESOLUTION_UNIT = 0x920A, 0xA405, 0xA20E, 0xA210
"""Tags of Exif 2.32, TIFF 6.0 and, for a profile, ICC.1."""
MILLIMETRES = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""Millimetres of the units of resolution; the default is inches."""
SENSORS = (1.0, 70.0)
"""Millimetres of the long side of sensors that there are, from endoscopes' to medium format's."""
ASPECT = 0.01
"""Relative difference of the shapes of a picture above which it was cropped: reducing rounds sides."""
_FORMATS = {1: "B", 2: "B", 3: "H", 4: "I", 5: "II", 7: "B", 9: "i", 10: "ii"}
"""Formats of the types of values that are used."""
Directory = dict[int, tuple[float, ...]]
"""The numbers of each entry by its tag; a fraction over 0 makes an entry that is missing."""


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
            block = parts(file.read(LARGEST)).get(b"eXIf", b"")
    except OSError:
        return None
    first = directory(block)
    held = directory(block, first[EXIF_IFD][0]) if EXIF_IFD in first else first
    if not held:
        return None
    tags = {tag: values[0] for tag, values in held.items()}
    resolution, unit = tags.get(RESOLUTION), MILLIMETRES.get(int(tags.get(RESOLUTION_UNIT, 2)))
    return PhotoData(
        int(tags.get(WIDTH, 0)) or None, int(tags.get(HEIGHT, 0)) or None,
        tags.get(FOCAL_MM) or None, tags.get(EQUIVALENT) or None,
        resolution / unit if resolution and unit else None,
    )  # fmt: skip


def is_adobe_rgb(block: bytes) -> bool:
    """Return whether a TIFF structure has the mark of a camera that was set to Adobe RGB (DCF 2.0)."""
    held = directory(block, directory(block).get(EXIF_IFD, (0,))[0])
    return directory(block, held.get(INTEROP_IFD, (0,))[0]).get(1, ())[:3] == (*b"R03",)


def parts(data: bytes) -> dict[bytes, bytes]:
    """Return the parts of a file that describe its picture, as PNG calls them.

    A JPEG's are "eXIf", "ICC" and the densities of "JFIF"; a TIFF file is all "eXIf".
    """
    if data[:4] in (b"II*\0", b"MM\0*"):
        return {b"eXIf": data}
    found = dict[bytes, bytes]()
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        place = 8
        while place + 8 <= len(data):
            size, kind = struct.unpack_from(">I4s", data, place)
            found.setdefault(kind, data[place + 8 : place + 8 + size])
            place += 12 + size
    place = 2
    while data[:2] == b"\xff\xd8" and place + 4 <= len(data) and data[place] == 0xFF:
        marker, size = data[place + 1], struct.unpack_from(">H", data, place + 2)[0]
        segment = data[place + 4 : place + 2 + size]
        if marker == 0xFF:  # padding
            size = -1
        elif marker == 0xE0 and segment[:5] == b"JFIF\0":
            found.setdefault(b"JFIF", segment[8:12])
        elif marker == 0xE1 and segment[:6] == b"Exif\0\0":
            found.setdefault(b"eXIf", segment[6:])
        elif marker == 0xE2 and segment[:12] == b"ICC_PROFILE\0":
            found[b"ICC"] = found.get(b"ICC", b"") + segment[14:]
        elif marker == 0xDA:  # the pixels
            break
        place += 2 + size
    return found


def directory(block: bytes, place: float | None = None) -> Directory:
    """Return a directory of a TIFF structure, by default the first one; empty if there is none."""
    block = block.removeprefix(b"Exif\0\0")
    order, found = {b"II": "<", b"MM": ">"}.get(block[:2]), Directory()
    with suppress(struct.error):
        start = int(struct.unpack_from(f"{order}I", block, 4)[0] if place is None else place)
        count = struct.unpack_from(f"{order}H", block, start)[0] if start else 0
        for at in range(start + 2, start + 2 + 12 * count, 12):
            with suppress(struct.error):
                tag, *entry = struct.unpack_from(f"{order}HHI", block, at)
                if values := _values(block, f"{order}", at + 8, *entry):
                    found[tag] = values
    return found


def _values(block: bytes, order: str, place: int, kind: int, count: int) -> tuple[float, ...]:
    """The numbers of an entry; empty for a kind that is not used, and for a fraction over 0."""
    form = f"{order}{count * len(_FORMATS.get(kind, ''))}{_FORMATS.get(kind, 'B')[0]}"
    where = place if struct.calcsize(form) <= 4 else struct.unpack_from(f"{order}I", block, place)[0]
    values = struct.unpack_from(form, block, where)
    if kind not in (5, 10):
        return values
    return tuple(a / b for a, b in zip(values[::2], values[1::2], strict=True)) if all(values[1::2]) else ()
