"""Types of the arrays in the core, by name. Docstrings of functions give their axes and units."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""float64 of any shape: places, depths and matrices."""
Ints = NDArray[np.int32]
"""int32 of any shape: indices and IDs."""
Indices = NDArray[np.intp]
"""intp of any shape: rows and columns, as `np.nonzero` gives them."""
Mask = NDArray[np.bool_]
"""bool, (h, w) of a picture's pixels or (n,) of places."""
Map = NDArray[np.float32]
"""float32, (h, w): one number a pixel; with a first axis, one for each level or channel."""
Bytes = NDArray[np.uint8]
"""uint8, (h, w) or (h, w, c): a picture as displayed (sRGB), or a small number a pixel."""
LinearRGBA = NDArray[np.float32]
"""float32, (h, w, 4): a picture in linear light, premultiplied with its alpha."""
LinearRGB = NDArray[np.float32]
"""float32, (h, w, 3) or (n, 3): colours in linear light."""


def in_channels(values: Map, count: int) -> Map:
    """(h, w, count) values (h, w) in every channel.

    NumPy takes several times as long to combine a picture with `values[..., None]`: pixel by pixel.

    >>> in_channels(np.ones((2, 3), np.float32), 4).shape
    (2, 3, 4)
    """
    return np.asarray(cv2.merge([values] * count), np.float32)
