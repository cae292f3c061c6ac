"""Blender's own EXR decoder for the core, which has none."""

from pathlib import Path

import bpy  # noqa: F401 - without it there is no imbuf
import imbuf
import numpy as np
from numpy.typing import NDArray

from ...core.base.regular_file import read_regular
from ...core.media.exr_parts import without_colours


def read(picture: Path | bytes) -> NDArray[np.float32]:
    """Return the pixels (H, W, 3 or 4) float32 of a file or its bytes, premultiplied, top row first.

    They are as stored: Blender itself would convert some of the colour spaces that a file can name.

    Raises:
        OSError: It is not a picture.
    """
    data = read_regular(picture) if isinstance(picture, Path) else picture
    image = imbuf.load_from_buffer(without_colours(data))
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
