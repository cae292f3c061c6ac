"""The thesis's three front ends for feature points (its section 4.3), each over OpenCV, beside our own.

All give `Tracks`, so that they are counted alike. Harris and Stephens, "A combined corner and edge detector",
1988; Lowe, "Distinctive image features from scale-invariant keypoints", 2004; Lucas and Kanade, 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.footage import Footage, to_gray8
from addon.core.reconstruction import Floats, Ints
from addon.core.tracks import Tracks, follow, track_features

Gray = NDArray[np.uint8]
Places = NDArray[np.float32]

APART = 7
"""Pixels between a point that is followed and a new one."""
QUALITY = 0.01
"""Smallest Harris response relative to the frame's strongest: OpenCV's usual one."""
HARRIS_K = 0.04
RATIO = 0.8
"""Lowe's: the best match's distance over the second best's."""
EPIPOLAR = 1.0
"""Pixels between a match and its epipolar line."""
LIFE = 3
"""Frames that a feature must be followed through to count as registered."""


def harris_klt(footage: Footage) -> Tracks:
    """Harris corners, followed by Lucas and Kanade's flow with a check there and back."""

    def detect(gray: Gray, free: Gray) -> Places:
        found = cv2.goodFeaturesToTrack(
            gray, 0, QUALITY, APART, mask=free, useHarrisDetector=True, k=HARRIS_K
        )
        return _places(found)

    return _followed(footage, detect)


def sift_klt(footage: Footage) -> Tracks:
    """SIFT's keypoints, followed as in `harris_klt`; only the detector differs."""
    sift = _sift()

    def detect(gray: Gray, free: Gray) -> Places:
        keypoints = sift.detect(gray, free)
        return _places(cv2.KeyPoint.convert(keypoints))[_first_of_each(keypoints)]

    return _followed(footage, detect)


def sift_sift(footage: Footage) -> Tracks:
    """SIFT's keypoints in every frame, matched to the frame before by their descriptors.

    A match must be the best one in both directions, clearly better than the second best, and fit the
    fundamental matrix of its pair of frames.
    """
    sift = _sift()
    numbers: list[Ints] = []
    places: list[Places] = []
    before = np.zeros((0, 128), np.float32)
    born = 0
    for frame in footage.frames:
        keypoints, described = sift.detectAndCompute(to_gray8(footage.read(frame)), None)
        kept = _first_of_each(keypoints)
        xy = _places(cv2.KeyPoint.convert(keypoints))[kept]
        after = np.zeros((0, 128), np.float32) if described is None else described[kept]
        number = np.full(len(xy), -1, np.int32)
        if places:
            old, new = matched(before, after)
            fits = _epipolar(places[-1][old], xy[new])
            number[new[fits]] = numbers[-1][old[fits]]
        fresh = number < 0
        number[fresh] = born + np.arange(fresh.sum())
        born += int(fresh.sum())
        numbers.append(number)
        places.append(xy)
        before = after
    return _tracks(footage, numbers, places, born)


def ours(footage: Footage) -> Tracks:
    """The add-on's own: Shi and Tomasi's corners spread over the frame, followed as in `harris_klt`."""
    return track_features(footage, lambda stage, done, total: None)


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


def matched(before: NDArray[np.float32], after: NDArray[np.float32]) -> tuple[Ints, Ints]:
    """Rows of (n, d) and (m, d) descriptors that belong together: each other's best by `RATIO`."""
    if len(before) < 2 or len(after) < 2:
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    squared = (before**2).sum(1)[:, None] + (after**2).sum(1) - 2 * before @ after.T
    best = squared.argmin(axis=1)
    first, second = np.partition(squared, 1, axis=1)[:, :2].T
    clear = np.maximum(first, 0) < RATIO**2 * second
    mutual = squared.argmin(axis=0)[best] == np.arange(len(before))
    old = np.nonzero(clear & mutual)[0]
    return old.astype(np.int32), best[old].astype(np.int32)


def _epipolar(a: Places, b: Places) -> NDArray[np.bool_]:
    """(n,) which pairs fit one fundamental matrix; none where there are too few to find it."""
    if len(a) < 8:
        return np.zeros(len(a), bool)
    matrix, fits = cv2.findFundamentalMat(a, b, cv2.FM_RANSAC, EPIPOLAR, 0.999)
    return np.zeros(len(a), bool) if matrix is None else fits.ravel() == 1


def _followed(footage: Footage, detect: Callable[[Gray, Gray], Places]) -> Tracks:
    """Points followed from frame to frame, with new ones where there are none."""
    numbers: list[Ints] = []
    places: list[Places] = []
    active, number = np.zeros((0, 2), np.float32), np.zeros(0, np.int32)
    before: Gray | None = None
    born = 0
    for frame in footage.frames:
        gray = to_gray8(footage.read(frame))
        if before is not None:
            active, kept = follow(before, gray, active)
            number = number[kept]
        fresh = detect(gray, _free(gray, active))
        active = np.concatenate([active, fresh])
        number = np.concatenate([number, born + np.arange(len(fresh))]).astype(np.int32)
        born += len(fresh)
        numbers.append(number)
        places.append(active)
        before = gray
    return _tracks(footage, numbers, places, born)


def _free(gray: Gray, points: Places) -> Gray:
    """(H, W) 255 where no point is within `APART` pixels, else 0."""
    taken = np.full(gray.shape, 255, np.uint8)
    column, row = np.rint(points).astype(int).T
    taken[row, column] = 0
    if not len(points):
        return taken
    return np.where(cv2.distanceTransform(taken, cv2.DIST_L2, 3) >= APART, 255, 0).astype(np.uint8)


def _sift() -> cv2.SIFT:
    """Upscaled the other way, which is the default, keypoints are a quarter of a pixel off."""
    return cv2.SIFT.create(enable_precise_upscale=True)


def _first_of_each(keypoints: Sequence[cv2.KeyPoint]) -> NDArray[np.intp]:
    """Rows of the keypoints, one a place: SIFT repeats one for each of its orientations."""
    places = _places(cv2.KeyPoint.convert(keypoints))
    return np.sort(np.unique(np.rint(4 * places), axis=0, return_index=True)[1])


def _places(found: Any) -> Places:
    """(n, 2) of what OpenCV returns, which is of several shapes, and nothing at all where it found none."""
    return np.zeros((0, 2), np.float32) if found is None else np.asarray(found, np.float32).reshape(-1, 2)


def _tracks(footage: Footage, numbers: list[Ints], places: list[Places], count: int) -> Tracks:
    """OpenCV counts pixels from the first one's centre, `Tracks` from its corner."""
    xy: Floats = np.concatenate(places).astype(np.float64) + 0.5
    index = np.repeat(np.arange(len(numbers)), [len(number) for number in numbers]).astype(np.int32)
    # Numbers ascend within each frame, as `Tracks` has them.
    order = np.lexsort([np.concatenate(numbers), index])
    return Tracks(
        footage.frames, footage.width, footage.height, index,
        np.concatenate(numbers)[order], xy[order], np.zeros((count, 3), np.uint8),
    )  # fmt: skip
