"""Blender's own EXR decoder for the core, which has none."""

from __future__ import annotations

from pathlib import Path

import bpy  # noqa: F401 - without it there is no imbuf
import imbuf
import numpy as np
from numpy.typing import NDArray

from ..core.media import picture_file


def read(path: Path) -> NDArray[np.float32]:
    """(H, W, 3 or 4) float32, top row first."""
    image = imbuf.load(str(path))
    if image is None:
        raise OSError(path)
    try:
        with image.with_buffer() as pixels:
            picture = np.array(pixels, dtype=np.float32)[::-1]
    finally:
        image.free()
    return picture if picture.shape[2] >= 3 else np.repeat(picture[..., :1], 3, axis=2)


def register() -> None:
    """Let picture files be read with it."""
    picture_file.exr_decoder = read


def unregister() -> None:
    """Undo `register`."""
    picture_file.exr_decoder = None
