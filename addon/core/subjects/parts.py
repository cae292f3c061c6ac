"""Connected parts of a mask."""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Mask


def touching(mask: Mask, those: Mask) -> Mask:
    """Return the connected parts of a mask (h, w) that share a pixel with another one (h, w)."""
    number, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    kept = np.zeros(number, bool)
    kept[labels[those & mask]] = True
    kept[0] = False
    return np.asarray(kept[labels])
