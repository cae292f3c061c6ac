"""Picture files with tags, written by other libraries and chunk by chunk."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from .exr_files import of_channels

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
