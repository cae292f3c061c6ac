"""Focus breathing: a lens that focuses nearer is farther from its sensor, and sees less."""

import cv2
import numpy as np

from ..base.arrays import Floats, Map

NEAREST = 0.5
"""Largest share of a focal length in a distance: at half, things are as large on the sensor as they are."""
MOST_ENLARGED, LEAST_ENLARGED = 1.25, 0.87
"""Bounds of the enlargement. The larger is `steady_path.MOST_ZOOM`; the smaller shows 7.5 % of the width past
either border, and other frames fill 8 % (`steady_path.FILLED`)."""


def enlargement(amount: float, focal: float, inverse: float, middle: float) -> float:
    """Return the factor by which the picture is larger than when the lens is focused at a middle distance.

    The image distance of a thin lens is f (1 + f / (Z - f)). A cinema lens changes by a part of it.

    Args:
        amount: The part.
        focal: Focal length f in scene units.
        inverse: Inverse depth in focus, 1 / scene units.
        middle: Inverse depth at which the factor is 1.
    """
    near, usual = (min(max(focal * each, 0.0), NEAREST) for each in (inverse, middle))
    found = (1 + amount * near / (1 - near)) / (1 + amount * usual / (1 - usual))
    return min(max(found, LEAST_ENLARGED), MOST_ENLARGED)


def magnified(picture: Map, factor: float, middle: Floats) -> Map:
    """Return a picture (H, W) or (H, W, c) enlarged by a factor about a place (2,) in pixels.

    Its border is repeated.
    """
    shift = np.column_stack([np.eye(2) / factor, (middle - 0.5) * (1 - 1 / factor)])
    size, flags = (picture.shape[1], picture.shape[0]), cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    whole = np.ascontiguousarray(picture)
    found = cv2.warpAffine(whole, shift, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.maximum(np.asarray(found, np.float32), 0)
