"""Filling unknown pixels from those around."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .arrays import Map, Mask


def nearest[T: np.generic](values: NDArray[T], known: Mask) -> NDArray[T]:
    """Replace unknown values by those of the nearest known pixel (Euclidean distance).

    They are unchanged if none or all are known.

    Args:
        values: (H, W) or (H, W, c).
        known: (H, W).
    """
    if known.all() or not known.any():
        return values
    return of_nearest(values, known)[0]


def of_nearest[T: np.generic](values: NDArray[T], seeds: Mask) -> tuple[NDArray[T], Map]:
    """Return the values of the seed nearest to each pixel, and the distance (H, W) in pixels, float32.

    Borgefors, "Distance transformations in digital images", 1986, with OpenCV's mask of 5x5 pixels.

    Args:
        values: (H, W) or (H, W, c).
        seeds: (H, W), at least one.
    """
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((int(label.max()) + 1, *values.shape[2:]), values.dtype)
    of_label[label[seeds]] = values[seeds]
    found: NDArray[T] = of_label[label]
    return found, np.asarray(distance, np.float32)
