"""Stored pixels as linear light, as display values, and as 8-bit pictures."""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.nearest_fill import nearest
from .colour_tags import ColourTag
from .picture_file import Pixels

ROUNDED = 4e-3
"""Difference of light between two profiles of one space, which round (`scene/sources/colour_space.SAME`)."""
BRIGHTEST = 65504.0
"""The largest number that a half float holds: sums over hundreds of views of it stay finite."""


def finite(picture: Pixels) -> tuple[Pixels, int]:
    """Return a picture (H, W, 3 or 4) with finite floats, and the number of corrected pixels.

    A pixel that is not finite takes the value of the nearest finite one. Floats are cut at 0 and `BRIGHTEST`.
    """
    if picture.dtype != np.float32:
        return picture, 0
    known = np.isfinite(picture).all(axis=2)
    filled = nearest(np.where(known[..., None], picture, np.float32(0)), known)
    return np.asarray(np.clip(filled, 0, BRIGHTEST), np.float32), int(np.count_nonzero(~known))


@cache
def same_colours(one: ColourTag | None, other: ColourTag | None) -> bool:
    """Return whether two tags of integers mean the same light; None is sRGB."""
    tags = [tag or ColourTag("sRGB") for tag in (one, other)]
    if tags[0] == tags[1]:
        return True
    if any(isinstance(tag.transfer, str) and tag.transfer != "sRGB" for tag in tags):
        return False
    srgb = decode_srgb(np.linspace(0, 1, 65536))
    curves = [srgb if tag.transfer == "sRGB" else tag.curve for tag in tags]
    parts = [*curves, *(tag.to_rec_709 for tag in tags)]
    return bool(max(np.abs(parts[0] - parts[1]).max(), np.abs(parts[2] - parts[3]).max()) < ROUNDED)


def to_linear(picture: Pixels) -> NDArray[np.float32]:
    """Return (H, W, 3 or 4) as stored -> (H, W, 4) float32, scene linear Rec.709, premultiplied alpha.

    Integers are sRGB encoded (IEC 61966-2-1), floats linear already. EXR is premultiplied in the file.
    """
    if picture.dtype == np.float32:
        colour = np.ascontiguousarray(picture[..., :3], dtype=np.float32)
    else:
        top = 255 if picture.dtype == np.uint8 else 65535
        table = decode_srgb(np.arange(top + 1) / top).astype(np.float32)
        whole = np.ascontiguousarray(picture[..., :3])
        # OpenCV's has 256 entries, and takes a quarter of the time.
        colour = np.asarray(cv2.LUT(whole, table), np.float32) if top == 255 else table[whole]
    out = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2RGBA), np.float32)
    if picture.shape[2] == 4:
        if picture.dtype == np.float32:
            out[..., 3] = picture[..., 3]
        else:
            out[..., 3] = picture[..., 3].astype(np.float32) / (255 if picture.dtype == np.uint8 else 65535)
            out[..., :3] *= out[..., 3:]
    return out


def to_rgb8(picture: Pixels) -> NDArray[np.uint8]:
    """Convert a stored picture (H, W, 3 or 4) to 8 bits (H, W, 3), display-encoded.

    Float pictures are linear light, which is clipped to [0, 1] and encoded as sRGB.
    """
    if picture.dtype == np.float32:
        return np.round(encode_srgb(np.clip(np.nan_to_num(picture[..., :3]), 0, 1)) * 255).astype(np.uint8)
    if picture.dtype == np.uint16:
        return (np.asarray(picture[..., :3], dtype=np.uint16) >> 8).astype(np.uint8)
    return np.ascontiguousarray(picture[..., :3], dtype=np.uint8)


def to_gray8(picture: Pixels, long_side: float = np.inf) -> NDArray[np.uint8]:
    """Convert a stored picture (H, W, 3 or 4) to 8 bits of display-encoded luma (h, w), as `to_rgb8` does.

    A larger picture is reduced to a longer side of `long_side` pixels.
    """
    gray = cv2.cvtColor(to_rgb8(picture), cv2.COLOR_RGB2GRAY)
    zoom = min(1.0, long_side / max(gray.shape))
    size = [max(round(side * zoom), 1) for side in gray.shape[::-1]]
    return np.asarray(gray if zoom == 1 else cv2.resize(gray, size, interpolation=cv2.INTER_AREA), np.uint8)


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert linear light in [0, 1], of any shape, to display values in [0, 1] (IEC 61966-2-1)."""
    return np.where(
        linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    )


def decode_srgb(encoded: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert display values in [0, 1], of any shape, to linear light in [0, 1] (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
