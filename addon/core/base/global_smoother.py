"""OpenCV's fast global smoother, the same to the bit with any number of threads."""

from __future__ import annotations

import threading

import cv2
import numpy as np

from .arrays import Bytes, Map

_LOCK = threading.Lock()
"""OpenCV has one number of threads for the whole process."""


def globally_smoothed(guide: Bytes, values: Map, reach: float, sigma: float) -> Map:
    """(h, w) values (h, w) smooth where a guide (h, w) or (h, w, 3) is; `reach` is lambda, `sigma` grey
    levels at which smoothing stops.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014. With several threads each
    takes a stripe, whose last columns are rounded otherwise: processes with other numbers of them found other
    depths.
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
