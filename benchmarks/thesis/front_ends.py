"""The thesis's three front ends for feature points (its section 4.3), each over OpenCV, beside our own.

All give `Tracks`, so that they are counted alike. Harris and Stephens, "A combined corner and edge detector",
1988; Lowe, "Distinctive image features from scale-invariant keypoints", 2004; Lucas and Kanade, 1981.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from addon.core.base.arrays import Bytes, Ints
from addon.core.media.clip import Footage
from addon.core.sfm.tracking.klt import HARRIS_K, Numbers, Places, follow
from addon.core.sfm.tracking.sift import Keypoints, epipolar, keypoints, make_sift, matched
from addon.core.sfm.tracking.tracks import Tracks, run, track_features

APART = 7
"""Pixels between a point that is followed and a new one."""
QUALITY = 0.01
"""Smallest Harris response relative to the frame's strongest: OpenCV's usual one."""
LIFE = 3
"""Frames that a feature must be followed through to count as registered."""


def harris_klt(footage: Footage) -> Tracks:
    """Harris corners, followed by Lucas and Kanade's flow with a check there and back."""

    def detect(gray: Bytes, free: Bytes) -> Places:
        found = cv2.goodFeaturesToTrack(
            gray, 0, QUALITY, APART, mask=free, useHarrisDetector=True, k=HARRIS_K
        )
        return np.zeros((0, 2), np.float32) if found is None else np.float32(found).reshape(-1, 2)

    return run(_Followed(detect).step, footage)


def sift_klt(footage: Footage) -> Tracks:
    """SIFT's keypoints, followed as in `harris_klt`; only the detector differs."""
    sift = make_sift()
    return run(_Followed(lambda gray, free: keypoints(sift, gray, free).places).step, footage)


def sift_sift(footage: Footage) -> Tracks:
    """SIFT's keypoints in every frame, matched to the frame before by their descriptors.

    A match must be the best one in both directions, clearly better than the second best, and fit the
    fundamental matrix of its pair of frames.
    """
    return run(_Matched().step, footage)


def ours(footage: Footage) -> Tracks:
    """The add-on's own: corners spread over the frame, followed as in `harris_klt`, held to their patches."""
    return track_features(footage)


FRONTS: dict[str, Callable[[Footage], Tracks]] = {
    "Harris/KLT": harris_klt,
    "SIFT/KLT": sift_klt,
    "SIFT/SIFT": sift_sift,
    "ours (Shi-Tomasi/KLT)": ours,
}


def registered(tracks: Tracks) -> Ints:
    """(F,) number of features in each frame that are followed through at least `LIFE` frames of the clip."""
    life = np.bincount(tracks.track, minlength=tracks.count)
    lasting = life[tracks.track] >= LIFE
    return np.bincount(tracks.frame_index[lasting], minlength=len(tracks.frames)).astype(np.int32)


class _Followed:
    """Points followed from frame to frame, with new ones where there are none."""

    def __init__(self, detect: Callable[[Bytes, Bytes], Places]) -> None:
        self._detect = detect
        self._before: Bytes | None = None
        self._numbers, self._places = np.zeros(0, np.int64), np.zeros((0, 2), np.float32)
        self._born = 0

    def step(self, gray: Bytes) -> tuple[Numbers, Places]:
        if self._before is not None:
            self._places, kept = follow(self._before, gray, self._places)
            self._numbers = self._numbers[kept]
        fresh = self._detect(gray, _free(gray, self._places))
        self._places = np.concatenate([self._places, fresh])
        self._numbers = np.concatenate([self._numbers, self._born + np.arange(len(fresh))])
        self._born += len(fresh)
        self._before = gray
        return self._numbers, self._places


class _Matched:
    """Keypoints matched to those of the frame before, and no others."""

    def __init__(self) -> None:
        self._sift = make_sift()
        self._before, self._numbers = Keypoints.none(), np.zeros(0, np.int64)
        self._born = 0

    def step(self, gray: Bytes) -> tuple[Numbers, Places]:
        found = keypoints(self._sift, gray)
        old, new = matched(self._before.descriptors, found.descriptors)
        fits = epipolar(self._before.places[old], found.places[new])
        numbers = np.full(len(found.places), -1)
        numbers[new[fits]] = self._numbers[old[fits]]
        fresh = numbers < 0
        numbers[fresh] = self._born + np.arange(fresh.sum())
        self._born += int(fresh.sum())
        order = np.argsort(numbers)
        self._before, self._numbers = found.kept(order), numbers[order]
        return self._numbers, self._before.places


def _free(gray: Bytes, points: Places) -> Bytes:
    """(H, W) 255 where no point is within `APART` pixels, else 0."""
    taken = np.full(gray.shape, 255, np.uint8)
    column, row = np.rint(points).astype(int).T
    taken[row, column] = 0
    if not len(points):
        return taken
    return np.where(cv2.distanceTransform(taken, cv2.DIST_L2, 3) >= APART, 255, 0).astype(np.uint8)
