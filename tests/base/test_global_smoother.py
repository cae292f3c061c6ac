"""The global smoother does not depend on how many threads there are."""

from __future__ import annotations

import cv2
import numpy as np

from addon.core.base.global_smoother import globally_smoothed


def test_threads_change_no_bit() -> None:
    rng = np.random.default_rng(0)
    values = rng.random((270, 480)).astype(np.float32)
    guide = (255 * rng.random((270, 480, 3))).astype(np.uint8)
    before, found = cv2.getNumThreads(), []
    try:
        for threads in (1, 2, 3, 8):
            cv2.setNumThreads(threads)
            found.append(globally_smoothed(guide, values, 4000.0, 6.0))
            assert cv2.getNumThreads() == threads
    finally:
        cv2.setNumThreads(before)
    assert all(np.array_equal(found[0], each) for each in found)
