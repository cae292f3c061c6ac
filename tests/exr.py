"""Reads what neither OpenCV nor Blender's Python does: the layers of an OpenEXR file."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np


def channels(file: Path) -> dict[str, np.ndarray]:
    """(H, W) of each channel of an uncompressed file of scan lines, by its whole name."""
    data = file.read_bytes()
    assert data[:4] == b"\x76\x2f\x31\x01", "not OpenEXR"
    at, header = 8, {}
    while data[at]:
        name, kind, _ = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        size = struct.unpack_from("<i", data, at)[0]
        header[name.decode()] = data[at + 4 : at + 4 + size]
        at += 4 + size
    assert header["compression"] == b"\0", "compressed"
    names, listed = [], header["channels"]
    while listed[0]:
        name, listed = listed.split(b"\0", 1)
        names.append((name.decode(), {1: "<f2", 2: "<f4"}[struct.unpack_from("<i", listed)[0]]))
        listed = listed[16:]
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    at += 1 + 8 * height
    row = np.dtype([("y", "<i4"), ("size", "<i4"), *((name, kind, (width,)) for name, kind in names)])
    lines = np.frombuffer(data, row, height, at)
    return {name: lines[name].astype(np.float32) for name, _ in names}
