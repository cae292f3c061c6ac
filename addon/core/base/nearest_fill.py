"""Filling unknown pixels from those around."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .arrays import Map, Mask


def nearest[T: np.generic](values: NDArray[T], known: Mask) -> NDArray[T]:
    """(H, W) or (H, W, c) values, those that are not known (H, W) replaced by those of the nearest pixel that
    is (Euclidean distance); as they are where none or all are known."""
    if known.all() or not known.any():
        return values
    return of_nearest(values, known)[0]


def of_nearest[T: np.generic](values: NDArray[T], seeds: Mask) -> tuple[NDArray[T], Map]:
    """(H, W) or (H, W, c) values of the seed (H, W) nearest to each pixel, and the distance to it in pixels,
    (H, W) float32. There must be a seed.

    Borgefors, "Distance transformations in digital images", 1986, with OpenCV's mask of 5x5 pixels.
    """
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((int(label.max()) + 1, *values.shape[2:]), values.dtype)
    of_label[label[seeds]] = values[seeds]
    found: NDArray[T] = of_label[label]
    return found, np.asarray(distance, np.float32)
