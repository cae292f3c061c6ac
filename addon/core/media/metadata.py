"""What the boxes of a QuickTime or MP4 file say that FFmpeg leaves out: lens and codecs of sound.

Apple, "QuickTime File Format", chapter "Metadata": moov > meta holds keys, which names, and ilst, the values.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from ..base.regular_file import open_regular
from ..camera.focal_length import PLAUSIBLE

EQUIVALENT = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
LARGEST = 2**26
"""Bytes of the part that is read; the pictures lie elsewhere."""


def equivalent_focal(video: Path) -> float | None:
    """The 35 mm equivalent in millimetres that the video says it was filmed with; None if it says nothing."""
    try:
        found = _value(_inside(_moov(video), b"meta"), EQUIVALENT)
    except (OSError, struct.error, IndexError, UnicodeDecodeError):
        return None
    return found if found is not None and PLAUSIBLE[0] < found < PLAUSIBLE[1] else None


def sound_codes(video: Path) -> list[str]:
    """The codec of each sound track by its four characters, such as "mp4a"; empty for other containers."""
    codes = []
    try:
        for kind, track in _boxes(_moov(video)):
            media = _inside(track, b"mdia") if kind == b"trak" else b""
            if _inside(media, b"hdlr")[8:12] == b"soun":
                entries = _inside(_inside(_inside(media, b"minf"), b"stbl"), b"stsd")
                codes.append(entries[12:16].decode("ascii", "replace").strip())
    except (OSError, struct.error):
        return []
    return codes


def _moov(video: Path) -> bytes:
    with open_regular(video) as file:
        end = video.stat().st_size
        place = 0
        while place + 8 <= end:
            file.seek(place)
            size, kind = struct.unpack(">I4s", file.read(8))
            if size == 1:
                (size,) = struct.unpack(">Q", file.read(8))
            elif size == 0:
                size = end - place
            if kind == b"moov":
                return file.read(min(size, LARGEST))
            if size < 8:
                break
            place += size
    return b""


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    place = 0
    while place + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, place)
        if size < 8:
            return
        yield kind, data[place + 8 : place + size]
        place += size


def _inside(data: bytes, wanted: bytes) -> bytes:
    return next((content for kind, content in _boxes(data) if kind == wanted), b"")


def _value(meta: bytes, name: str) -> float | None:
    # In an MP4 four bytes of version come first, in a MOV the boxes at once.
    boxes = dict(_boxes(meta)) if meta[4:8] == b"hdlr" else dict(_boxes(meta[4:]))
    keys, place = boxes.get(b"keys", b""), 8
    names = []
    while place + 8 <= len(keys):
        (size,) = struct.unpack_from(">I", keys, place)
        if size < 8:
            return None
        names.append(keys[place + 8 : place + size].decode())
        place += size
    if name not in names:
        return None
    number = struct.pack(">I", names.index(name) + 1)
    data = _inside(_inside(boxes.get(b"ilst", b""), number), b"data")
    kind, content = struct.unpack_from(">I", data)[0], data[8:]
    if kind == 23:
        return float(struct.unpack(">f", content)[0])
    if kind == 24:
        return float(struct.unpack(">d", content)[0])
    if kind in (21, 22) and 1 <= len(content) <= 8:
        return float(int.from_bytes(content, "big", signed=kind == 21))
    return None
