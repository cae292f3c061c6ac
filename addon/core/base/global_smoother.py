"""OpenCV's fast global smoother, the same to the bit with any number of threads."""

from __future__ import annotations

import threading

import cv2
import numpy as np

from .arrays import Bytes, Map

_LOCK = threading.Lock()
"""OpenCV has one number of threads for the whole process."""


def globally_smoothed(guide: Bytes, values: Map, reach: float, sigma: float) -> Map:
    """Return values (h, w), smoothed where a guide (h, w) or (h, w, 3) is smooth.

    Min et al., "Fast global image smoothing based on weighted least squares", 2014. It runs in one thread:
    several threads have a stripe each, whose last columns are rounded differently, so that results would
    depend on their number.

    Args:
        guide: Grey levels or RGB.
        values: (h, w).
        reach: Lambda.
        sigma: Grey levels at which smoothing stops.
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
