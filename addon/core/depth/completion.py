"""What the sweep cannot say: depth where there are only sparse points, and smooth surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..base.global_smoother import globally_smoothed


@dataclass(frozen=True)
class CompletionOptions:
    """Edge-aware interpolation and smooth surfaces. Chosen by inspection, then judged
    together on the scenes with true depth by `python -m benchmarks.accuracy.dense_depth`."""

    smoother_lambda: float = 400.0
    """Lambda of the fast global smoother that interpolates known depth. Chosen by inspection."""
    smoother_sigma: float = 6.0
    """Grey levels at which that smoother stops. Chosen by inspection."""
    least_weight: float = 1e-6
    """Weight, against 1 for a known pixel, of the default depth where nothing known reaches. Chosen by
    inspection."""
    filter_window: int = 9
    """Pixels across the bilateral filter that smooths surfaces. Chosen by inspection."""
    filter_sigma_level: float = 1.5
    """Levels: standard deviation of that bilateral filter in depth. Chosen by inspection."""
    filter_sigma_space: float = 3.0
    """Pixels: standard deviation of that bilateral filter in the picture. Chosen by inspection."""


def interpolate(guide: Map, value: Map, weight: Map, default: float, options: CompletionOptions) -> Map:
    """(h, w) values interpolated from where their weight (h, w) is high, along the surfaces of a picture (h,
    w) in grey levels; `default` where no weight reaches.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014, of weight * value over
    that of weight.
    """
    picture = np.clip(guide, 0, 255).astype(np.uint8)
    scale = abs(default) or 1.0
    above, below = (
        globally_smoothed(picture, part, options.smoother_lambda, options.smoother_sigma)
        for part in (weight * (value / scale - default / scale), weight)
    )
    return np.asarray(default + scale * above / (np.maximum(below, 0) + options.least_weight), np.float32)


def splat(xy: Floats, value: Floats, shape: tuple[int, int]) -> tuple[Map, Map]:
    """Mean of the values (n,) at places (n, 2) in each pixel (h, w), and how many there are."""
    height, width = shape
    column, row = np.floor(xy).astype(int).T
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    flat = row[inside] * width + column[inside]
    count = np.bincount(flat, minlength=height * width)
    total = np.bincount(flat, weights=value[inside], minlength=height * width)
    mean = total / np.maximum(count, 1)
    return mean.reshape(shape).astype(np.float32), count.reshape(shape).astype(np.float32)


def smooth(level: Map, options: CompletionOptions) -> Map:
    """(h, w) levels without the unevenness of surfaces; jumps stay.

    Tomasi and Manduchi, "Bilateral filtering for gray and color images", 1998, then a median of 3x3.
    """
    filtered = cv2.bilateralFilter(
        level, options.filter_window, options.filter_sigma_level, options.filter_sigma_space
    )
    return np.asarray(cv2.medianBlur(filtered, 3), np.float32)
