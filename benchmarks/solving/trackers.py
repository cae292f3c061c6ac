"""Trackers that the product's two are compared with, and a solving worker that uses one of them.

`python -m benchmarks.solving.trackers NAME FOLDER` solves as `addon.core.sfm.worker` does.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.arrays import Bytes
from addon.core.media.clip import Footage
from addon.core.sfm import worker
from addon.core.sfm.tracking.klt import (
    CELLS,
    QUALITY,
    Places,
    TwoScales,
    best_of_cells,
    new_corners,
    strongest_corners,
)
from addon.core.sfm.tracking.sift import CONTRAST, keypoints, make_sift
from addon.core.sfm.tracking.tracks import Step, Tracks, Watch, match_features, run

RENEW = 0.9
"""Share of the points followed below which new ones are looked for: finding them is slow."""


class SiftDetector:
    """SIFT's keypoints for `KLTTracker`, the strongest of each cell that holds no point."""

    def __init__(self) -> None:
        self._sift = make_sift(CONTRAST)
        self._last_count = 0.0

    def __call__(self, gray: Bytes, points: Places) -> Places:
        """New points (k, 2) of a frame (H, W) beside those there are (n, 2); none while there are enough."""
        if len(points) > RENEW * self._last_count:
            return np.zeros((0, 2), np.float32)
        found = keypoints(self._sift, gray)
        column, row = np.clip(np.rint(found.places).astype(int), 0, np.array(gray.shape[::-1]) - 1).T
        strength, which = np.zeros(gray.shape, np.float32), np.zeros(gray.shape, np.int32)
        weakest_first = np.argsort(found.response)
        strength[row[weakest_first], column[weakest_first]] = found.response[weakest_first]
        which[row[weakest_first], column[weakest_first]] = weakest_first
        column, row = best_of_cells(strength, 0.0, points, CELLS).T
        self._last_count = float(len(points) + len(column))
        return np.asarray(found.places[which[row, column]], np.float32)


def eigenvalue_corners(gray: Bytes, points: Places) -> Places:
    """As `new_corners`, by the smaller eigenvalue of the structure tensor.

    Shi and Tomasi, "Good features to track", 1994.
    """
    return strongest_corners(gray, points, cv2.cornerMinEigenVal(gray, 3), QUALITY, CELLS)


TRACKERS: dict[str, Callable[[], Step]] = {
    "harris": lambda: TwoScales(new_corners).step,
    "corners": lambda: TwoScales(eigenvalue_corners).step,
    "sift-klt": lambda: TwoScales(SiftDetector()).step,
}
"""Points that optical flow follows, by name, the product's own first."""
NAMES = (*TRACKERS, "sift")
"""All that are compared; the last is the product's own for fast motion."""


def main(name: str, folder: str) -> None:
    """Solve into a folder by a tracker in place of the product's first."""

    def track(footage: Footage, watch: Watch = lambda *_: None) -> Tracks:
        if name == "sift":
            return match_features(footage)
        return run(TRACKERS[name](), footage, watch)

    vars(worker)["track_features"] = track
    worker.main(Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
