"""Depth between sparse points, and smooth surfaces."""

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..base.global_smoother import globally_smoothed

SMOOTHER_LAMBDA = 400.0
"""Lambda of the fast global smoother that interpolates known depth: a larger one reaches farther."""
SMOOTHER_SIGMA = 6.0
"""Sigma of the fast global smoothers along pictures: the difference of neighbouring pixels, in grey levels of
0 to 255, at which their weight falls to 1 / e."""
LEAST_WEIGHT = 1e-6
"""Weight, against 1 for a known pixel, of the default depth where nothing known reaches."""
FILTER_WINDOW = 9
"""Pixels across the bilateral filter that smooths surfaces."""
FILTER_SIGMA_LEVEL = 1.5
"""Standard deviation of the bilateral filter in levels."""
FILTER_SIGMA_SPACE = 3.0
"""Standard deviation of the bilateral filter in pixels."""


def interpolate(guide: Map, value: Map, weight: Map, default: float) -> Map:
    """Interpolate values (h, w) of a weight (h, w) along the surfaces of a picture (h, w) in grey levels.

    The smoothed weight * value over the smoothed weight: Min et al., "Fast global image smoothing based on
    weighted least squares", 2014. Where no weight reaches, the result is `default`.
    """
    picture = np.clip(guide, 0, 255).astype(np.uint8)
    scale = abs(default) or 1.0
    above, below = (
        globally_smoothed(picture, part, SMOOTHER_LAMBDA, SMOOTHER_SIGMA)
        for part in (weight * (value / scale - default / scale), weight)
    )
    return np.asarray(default + scale * above / (np.maximum(below, 0) + LEAST_WEIGHT), np.float32)


def splat(xy: Floats, value: Floats, shape: tuple[int, int]) -> tuple[Map, Map]:
    """Return the mean of the values (n,) at places (n, 2) in each pixel (h, w), and their number."""
    height, width = shape
    column, row = np.floor(xy).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    flat = row[inside] * width + column[inside]
    count = np.bincount(flat, minlength=height * width)
    total = np.bincount(flat, weights=value[inside], minlength=height * width)
    mean = total / np.maximum(count, 1)
    return mean.reshape(shape).astype(np.float32), count.reshape(shape).astype(np.float32)


def smooth(level: Map) -> Map:
    """Return (h, w) levels without the unevenness of surfaces; jumps stay.

    Tomasi and Manduchi, "Bilateral filtering for gray and color images", 1998, then a median of 3x3.
    """
    filtered = cv2.bilateralFilter(level, FILTER_WINDOW, FILTER_SIGMA_LEVEL, FILTER_SIGMA_SPACE)
    return np.asarray(cv2.medianBlur(filtered, 3), np.float32)
