"""Filling unknown pixels from those around."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def nearest[T: np.generic](values: NDArray[T], known: NDArray[np.bool_]) -> NDArray[T]:
    """(H, W) or (H, W, c) values, those that are not known (H, W) replaced by those of the nearest pixel that
    is (Euclidean distance); as they are where none or all are known."""
    if known.all() or not known.any():
        return values
    _, label = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((int(label.max()) + 1, *values.shape[2:]), values.dtype)
    of_label[label[known]] = values[known]
    filled: NDArray[T] = of_label[label]
    return filled
