"""Types of the arrays that the core passes around; functions document their axes and units."""

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""float64 of any shape: positions, depths and matrices."""
Ints = NDArray[np.int32]
"""int32 of any shape: indices and IDs."""
Indices = NDArray[np.intp]
"""intp of any shape: rows and columns, as `np.nonzero` returns them."""
Mask = NDArray[np.bool_]
"""bool, (h, w) for the pixels of a picture or (n,) for positions."""
Map = NDArray[np.float32]
"""float32, (h, w): one number a pixel. A first axis separates levels or channels."""
Bytes = NDArray[np.uint8]
"""uint8, (h, w) or (h, w, c): a displayed picture (sRGB), or a small number a pixel."""
LinearRGBA = NDArray[np.float32]
"""float32, (h, w, 4): a picture in linear light with premultiplied alpha."""
LinearRGB = NDArray[np.float32]
"""float32, (h, w, 3) or (n, 3): colours in linear light."""


def in_channels(values: Map, count: int) -> Map:
    """Repeat values (h, w) in each channel of an array (h, w, count).

    NumPy takes several times as long to combine a picture with `values[..., None]`, pixel by pixel.

    >>> in_channels(np.ones((2, 3), np.float32), 4).shape
    (2, 3, 4)
    """
    return np.asarray(cv2.merge([values] * count), np.float32)


def pixel_centres(width: int, height: int) -> Floats:
    """Return the centres (height, width, 2) of a picture's pixels."""
    return np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)


def repeated[T: np.generic](values: NDArray[T], times: int) -> NDArray[T]:
    """Repeat values (H, W) along rows and columns, as (times H, times W)."""
    return np.asarray(np.repeat(np.repeat(values, times, axis=0), times, axis=1))
