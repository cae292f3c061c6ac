"""Filling of unknown pixels from known ones."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .arrays import Map, Mask


def nearest[T: np.generic](values: NDArray[T], known: Mask) -> NDArray[T]:
    """Replace unknown values (H, W) or (H, W, c) by those of the nearest known pixel, if there is one."""
    if known.all() or not known.any():
        return values
    return of_nearest(values, known)[0]


def of_nearest[T: np.generic](values: NDArray[T], seeds: Mask) -> tuple[NDArray[T], Map]:
    """Return the values (H, W) or (H, W, c) of the nearest seed, and its Euclidean distance (H, W) in pixels.

    Borgefors, "Distance transformations in digital images", 1986, with OpenCV's mask of 5x5 pixels. `seeds`
    (H, W) must not be empty.
    """
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((int(label.max()) + 1, *values.shape[2:]), values.dtype)
    of_label[label[seeds]] = values[seeds]
    found: NDArray[T] = of_label[label]
    return found, np.asarray(distance, np.float32)
