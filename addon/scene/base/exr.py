"""Blender's own EXR decoder for the core, which has none."""

from pathlib import Path

import bpy  # noqa: F401 - without it there is no imbuf
import imbuf
import numpy as np
from numpy.typing import NDArray

from ...core.media import picture_file


def read(picture: Path | bytes) -> NDArray[np.float32]:
    """Return the pixels (H, W, 3 or 4) float32 of a file or its bytes, premultiplied, top row first.

    Raises:
        OSError: It is not a picture.
    """
    is_file = isinstance(picture, Path)
    image = imbuf.load(str(picture)) if is_file else imbuf.load_from_buffer(picture)
    if image is None:
        raise OSError("it is not an image")
    try:
        with image.with_buffer() as pixels:
            shown = np.array(pixels, dtype=np.float32)[::-1]
    finally:
        image.free()
    if shown.shape[2] == 4:
        # It takes colours for straight and multiplies them; in the file they are premultiplied. Light where
        # alpha is 0 is lost.
        alpha = shown[..., 3:]
        np.divide(shown[..., :3], alpha, out=shown[..., :3], where=alpha > 0)
    return shown if shown.shape[2] >= 3 else np.repeat(shown[..., :1], 3, axis=2)


def register() -> None:
    """Let picture files be read with it."""
    picture_file.exr_decoder = read


def unregister() -> None:
    """Undo `register`."""
    picture_file.exr_decoder = None
