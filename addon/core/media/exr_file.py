"""Writer of OpenEXR files with any channels, by "Technical Introduction to OpenEXR" and "File Layout".

Blender writes such files from renders only, with its own names; other writers are not packaged (see
`picture_file`).
"""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.progress import checkpoint
from .exr_parts import header_bytes

Samples = NDArray[np.float16] | NDArray[np.float32]
_ZIP, _ZIP_ROWS = 3, 16
"""The compression, and how many rows it takes together."""
_KINDS = {np.dtype(np.float16): 1, np.dtype(np.float32): 2}
LEVEL = 4
"""Level of zlib: a frame of 1280x720 takes 0.10 s and 1.4 % more bytes than by the default one in 0.28 s."""


def write_exr(path: Path, channels: Mapping[str, Samples]) -> None:
    """Write channels (H, W), float16 or float32, top row first, under their full names: "Front.Combined.R".

    Scan lines, lossless ZIP. ValueError for channels of different sizes or other types; raises OSError.
    Passes checkpoints.
    """
    names = sorted(channels)
    sizes = {channels[name].shape for name in names}
    kinds = [_KINDS.get(channels[name].dtype) for name in names]
    if len(sizes) != 1 or None in kinds:
        raise ValueError(f"channels must be float16 or float32 of one size, not {sizes}")
    height, width = sizes.pop()
    header = _header([(name, kind or 0) for name, kind in zip(names, kinds, strict=True)], width, height)
    firsts = range(0, height, _ZIP_ROWS)
    offsets: list[int] = []
    with path.open("wb") as file:
        file.write(header)
        file.write(bytes(8 * len(firsts)))
        for first in firsts:
            checkpoint(first / height)
            offsets.append(file.tell())
            rows = slice(first, first + _ZIP_ROWS)
            # A row is all of one channel, then all of the next.
            lines = [channels[name][rows] for name in names]
            little = [np.ascontiguousarray(each, each.dtype.newbyteorder("<")) for each in lines]
            packed = _packed(np.concatenate([each.view(np.uint8) for each in little], axis=1).ravel())
            file.write(struct.pack("<2i", first, len(packed)))
            file.write(packed)
        file.seek(len(header))
        file.write(struct.pack(f"<{len(offsets)}Q", *offsets))


def _packed(data: NDArray[np.uint8]) -> bytes:
    """Bytes (n,) compressed as by OpenEXR's ZIP; unchanged if that is not shorter."""
    apart = np.concatenate([data[::2], data[1::2]])
    apart[1:] = apart[1:] - apart[:-1] + np.uint8(128)
    packed = zlib.compress(apart.tobytes(), LEVEL)
    return packed if len(packed) < data.size else data.tobytes()


def _header(channels: list[tuple[str, int]], width: int, height: int) -> bytes:
    """The bytes before the table of offsets; channels by name and kind."""
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name, kind in channels
    )
    box = b"box2i", struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = {
        "channels": (b"chlist", listed + b"\0"),
        "compression": (b"compression", bytes([_ZIP])),
        "dataWindow": box,
        "displayWindow": box,
        "lineOrder": (b"lineOrder", b"\0"),
        "pixelAspectRatio": (b"float", struct.pack("<f", 1.0)),
        "screenWindowCenter": (b"v2f", struct.pack("<2f", 0.0, 0.0)),
        "screenWindowWidth": (b"float", struct.pack("<f", 1.0)),
    }
    return header_bytes(attributes, [name for name, _ in channels])
