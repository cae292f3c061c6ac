"""Picture files as other programs write them, with tags and layers, and the layers of EXR files read back."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

MODES = {
    ".png": ("L", "LA", "RGB", "RGBA", "P", "I;16", "RGB16", "RGBA16"),
    ".jpg": ("L", "RGB"),
    ".tif": ("L", "RGB", "RGBA", "I;16"),
}
"""Pillow's modes by the file's ending, and two of OpenCV's."""


def blocks(mode: str, width: int = 48, height: int = 32) -> np.ndarray:
    """(H, W) or (H, W, n) blocks of 8 pixels, which JPEG keeps, all different."""
    deep = mode.endswith("16")
    draw = np.random.default_rng(5)
    channels = {"L": 1, "I;16": 1, "LA": 2, "RGB": 3, "P": 3, "RGB16": 3}.get(mode, 4)
    tops = draw.permutation(width * height // 64).reshape(height // 8, width // 8, 1) * 9 + 20
    values = np.kron((tops + 5 * np.arange(channels)) % 230 + 20, np.ones((8, 8, 1)))
    values = values.astype(np.uint16) * 257 if deep else values.astype(np.uint8)
    return np.asarray(values[..., 0] if channels == 1 else values)


def encoded(suffix: str, mode: str, orientation: int = 1, **options: object) -> bytes:
    """The bytes of a picture of `blocks`, with an orientation of Exif."""
    exif = Image.Exif()
    exif[0x112] = orientation
    stored = blocks(mode)
    if mode in ("RGB16", "RGBA16"):
        order = [2, 1, 0, 3][: stored.shape[2]]
        return with_chunks(cv2.imencode(".png", stored[..., order])[1].tobytes(), eXIf=exif.tobytes()[6:])
    made, file = Image.fromarray(stored), io.BytesIO()
    if mode == "P":
        made = made.quantize(64)
    if suffix == ".jpg":
        options |= {"quality": 98, "subsampling": 0}
    made.save(file, {".png": "PNG", ".jpg": "JPEG", ".tif": "TIFF"}[suffix], exif=exif, **options)
    return file.getvalue()


def with_chunks(png: bytes, **chunks: bytes) -> bytes:
    """A PNG with more chunks, after its header."""
    made = b""
    for name, data in chunks.items():
        body = name.encode() + data
        made += struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    return png[:33] + made + png[33:]


def with_profile(jpeg: bytes, profile: bytes, step: int = 65000) -> bytes:
    """A JPEG with an ICC profile, in segments of so many bytes."""
    parts = [profile[at : at + step] for at in range(0, len(profile), step)]
    made = b""
    for number, part in enumerate(parts, 1):
        body = b"ICC_PROFILE\0" + bytes([number, len(parts)]) + part
        made += b"\xff\xe2" + struct.pack(">H", len(body) + 2) + body
    return jpeg[:2] + made + jpeg[2:]


def exr(picture: np.ndarray, **more: tuple[str, bytes]) -> bytes:
    """An EXR of (H, W, 3) with attributes, type and value by name."""
    return of_channels({name: picture[..., at] for at, name in enumerate("RGB")}, more=more)


def sequence(folder: Path, data: bytes, suffix: str, count: int = 2) -> Path:
    """A folder of so many equal pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, count + 1):
        (folder / f"f_{number:04d}{suffix}").write_bytes(data)
    return folder


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
