"""EXR files as other programs write them: half floats in any channels, which Blender does not write."""

from __future__ import annotations

import struct

import numpy as np


def one_channel(values: np.ndarray, name: str = "Z") -> bytes:
    """The bytes of an EXR of (h, w) in one channel, as depth networks write them."""
    return of_channels({name: values})


def of_channels(
    values: dict[str, np.ndarray],
    data: tuple[int, int] = (0, 0),
    display: tuple[int, int, int, int] | None = None,
    tiled: bool = False,
    more: dict[str, tuple[str, bytes]] | None = None,
) -> bytes:
    """The bytes of an EXR, version 2, uncompressed, of (h, w) half floats by channel (OpenEXR, "File
    Layout").

    `data` is the left and top pixel of the data window, `display` the display window, by default the same.
    `more` are attributes, type and value by name.
    """
    names = sorted(values)
    height, width = values[names[0]].shape
    window = (*data, data[0] + width - 1, data[1] + height - 1)
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", 1, 0, 1, 1) for name in names)
    attributes = {
        ("channels", "chlist"): listed + b"\0",
        ("compression", "compression"): b"\0",
        ("dataWindow", "box2i"): struct.pack("<4i", *window),
        ("displayWindow", "box2i"): struct.pack("<4i", *(display or window)),
        ("lineOrder", "lineOrder"): b"\0",
        ("pixelAspectRatio", "float"): struct.pack("<f", 1.0),
        ("screenWindowCenter", "v2f"): struct.pack("<2f", 0.0, 0.0),
        ("screenWindowWidth", "float"): struct.pack("<f", 1.0),
    }
    for name, (kind, value) in (more or {}).items():
        attributes[name, kind] = value
    if tiled:
        attributes["tiles", "tiledesc"] = struct.pack("<2IB", width, height, 0)
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2 | 0x200 * tiled)
    for (key, kind), value in attributes.items():
        header += key.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    header += b"\0"
    lines = np.stack([values[name].astype("<f2") for name in names], axis=1)
    if tiled:
        rows = [struct.pack("<5i", 0, 0, 0, 0, lines.nbytes) + lines.tobytes()]
    else:
        rows = [
            struct.pack("<2i", data[1] + row, line.nbytes) + line.tobytes() for row, line in enumerate(lines)
        ]
    begin = len(header) + 8 * len(rows)
    table = b"".join(struct.pack("<Q", begin + row * len(rows[0])) for row in range(len(rows)))
    return header + table + b"".join(rows)
