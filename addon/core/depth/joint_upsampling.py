"""Depth found in a small picture for every pixel of the large one."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA
from ..base.progress import checkpoint

COLOUR_DISTANCE = 0.04
"""Distance of colours (display values in [0, 1]) worth a small picture's pixel. Chosen by inspection."""
DISCONTINUITY = 0.03
"""Share of the largest inverse depth beyond which neighbours have no mean. Chosen by inspection."""


def upsampled(depth: NDArray[np.floating], picture: LinearRGBA) -> Floats:
    """Return small inverse depths (h, w) at the size (H, W) of a picture (H, W, 4), with its edges.

    The value comes from the neighbour that is nearest and most alike in colour, of four. Kopf et al., "Joint
    bilateral upsampling", 2007, with a single vote.
    """
    height, width = picture.shape[:2]
    if depth.shape == (height, width):
        return depth.astype(np.float64)
    small = depth.astype(np.float32)
    shown = cv2.pow(np.clip(picture[..., :3], 0, 1), 1 / 2.2)
    guide = cv2.resize(shown, small.shape[::-1], interpolation=cv2.INTER_AREA)
    x = (np.arange(width, dtype=np.float32) + 0.5) * (small.shape[1] / width) - 0.5
    y = (np.arange(height, dtype=np.float32) + 0.5) * (small.shape[0] / height) - 0.5
    # The four neighbours in the small picture; past its border those at it.
    rows, columns = (
        [np.clip(np.floor(at) + step, 0, n - 1).astype(int) for step in (0, 1)]
        for at, n in zip((y, x), small.shape, strict=True)
    )
    weights = [
        (1 - np.abs(y - row))[:, None] * (1 - np.abs(x - column))
        for row in (np.floor(y), np.floor(y) + 1)
        for column in (np.floor(x), np.floor(x) + 1)
    ]
    neighbours = [(row, column) for row in rows for column in columns]
    found, low, high = (np.full((height, width), fill, np.float32) for fill in (0, np.inf, -np.inf))
    for weight, at in zip(weights, neighbours, strict=True):
        checkpoint(1.0)
        value = small[np.ix_(*at)]
        found += weight * value
        np.minimum(low, value, out=low)
        np.maximum(high, value, out=high)
    # Colours are compared where they differ.
    row, column = np.nonzero(high - low > DISCONTINUITY * float(small.max(initial=0)))
    own, best = shown[row, column], np.full(len(row), np.inf, np.float32)
    for weight, (rows_of, columns_of) in zip(weights, neighbours, strict=True):
        checkpoint(1.0)
        at = rows_of[row], columns_of[column]
        unlike = own - guide[at]
        off = np.sqrt(np.einsum("nc,nc->n", unlike, unlike)) / np.float32(COLOUR_DISTANCE)
        off += 1 - weight[row, column]
        nearer = off < best
        best[nearer] = off[nearer]
        found[row[nearer], column[nearer]] = small[at][nearer]
    return found.astype(np.float64)
