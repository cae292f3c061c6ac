"""EXR files as other programs write them: half floats in any channels, which Blender does not write."""

from __future__ import annotations

import struct

import numpy as np


def one_channel(values: np.ndarray, name: str = "Z") -> bytes:
    """The bytes of an EXR of (h, w) in one channel, as depth networks write them."""
    return of_channels({name: values})


def of_channels(values: dict[str, np.ndarray]) -> bytes:
    """The bytes of an EXR, version 2, uncompressed, of (h, w) half floats by channel (OpenEXR, "File
    Layout")."""
    names = sorted(values)
    height, width = values[names[0]].shape
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", 1, 0, 1, 1) for name in names)
    attributes = {
        ("channels", "chlist"): listed + b"\0",
        ("compression", "compression"): b"\0",
        ("dataWindow", "box2i"): box,
        ("displayWindow", "box2i"): box,
        ("lineOrder", "lineOrder"): b"\0",
        ("pixelAspectRatio", "float"): struct.pack("<f", 1.0),
        ("screenWindowCenter", "v2f"): struct.pack("<2f", 0.0, 0.0),
        ("screenWindowWidth", "float"): struct.pack("<f", 1.0),
    }
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2)
    for (key, kind), data in attributes.items():
        header += key.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data
    header += b"\0"
    lines = np.stack([values[name].astype("<f2") for name in names], axis=1)
    rows = [struct.pack("<2i", row, line.nbytes) + line.tobytes() for row, line in enumerate(lines)]
    begin = len(header) + 8 * height
    table = b"".join(struct.pack("<Q", begin + row * len(rows[0])) for row in range(height))
    return header + table + b"".join(rows)
