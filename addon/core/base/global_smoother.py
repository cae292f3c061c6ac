"""OpenCV's fast global smoother with results that do not depend on the number of threads."""

import cv2
import numpy as np

from .arrays import Bytes, Map
from .side_by_side import Lock

_LOCK = Lock()
"""Guards OpenCV's number of threads, which is global."""


def globally_smoothed(guide: Bytes, values: Map, reach: float, sigma: float) -> Map:
    """Smooth values (h, w) where a guide (h, w) or (h, w, 3) is smooth.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014, with lambda `reach` and
    `sigma` in grey levels. One thread: others round the last columns of their stripes differently, which
    changed the depth.
    """
    values = np.ascontiguousarray(values, np.float32)
    with _LOCK:
        before = cv2.getNumThreads()
        cv2.setNumThreads(1)
        try:
            smooth = cv2.ximgproc.fastGlobalSmootherFilter(guide, values, reach, sigma)
        finally:
            cv2.setNumThreads(before)
    return np.asarray(smooth, np.float32)
