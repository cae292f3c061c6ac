"""SIFT keypoints, matched from frame to frame and over gaps.

Lowe, "Distinctive image features from scale-invariant keypoints", 2004. Places are OpenCV's, the first
pixel's middle at (0, 0).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bytes, Ints, Mask
from .klt import CELLS, Numbers, Places, cell_size, neighbour_consistency
from .template_tracking import Patches, Rows

Descriptors = NDArray[np.float32]
# Chosen by inspection of tracks where no line below names a paper.
CONTRAST = 0.01
"""Contrast of a keypoint at least, of 1; a quarter of OpenCV's default: weak regions must have some."""
PER_CELL = 3
"""Keypoints in each cell of the frame, at most, that are matched."""
MAX_RATIO = 0.8
"""Distance of the best match over the second best's, at most (Lowe's paper, section 7.1)."""
PATIENCE = 10
"""Frames after which a keypoint that was followed and is not found any more is given up."""
MAX_EPIPOLAR = 1.0
"""Pixels between a match and its epipolar line, at most."""
JUMP = 2.0
"""Pixels a frame by which a match may move otherwise than its neighbours."""
MIN_SUPPORT = 16
"""Matches that must agree on how the camera moved."""
MIN_AGREEING = 0.5
"""Share of all matches that must agree on how the camera moved; across a cut, chance has fewer."""


@dataclass
class Keypoints(Rows):
    """SIFT keypoints of a frame, one for each place; SIFT repeats places for its orientations."""

    places: Places
    """(n, 2)"""
    response: NDArray[np.float32]
    """(n,) contrast."""
    descriptors: Descriptors
    """(n, 128)"""

    @classmethod
    def none(cls) -> Keypoints:
        """Return no keypoints."""
        return cls(np.zeros((0, 2), np.float32), np.zeros(0, np.float32), np.zeros((0, 128), np.float32))


def make_sift(contrast: float = 0.04) -> cv2.SIFT:
    """Upscaled the other way, which is the default, keypoints are a quarter of a pixel off."""
    return cv2.SIFT.create(contrastThreshold=contrast, enable_precise_upscale=True)


def keypoints(sift: cv2.SIFT, gray: Bytes, mask: Bytes | None = None) -> Keypoints:
    """Return the keypoints of a frame (H, W), where a mask of the same shape is not zero."""
    found, descriptors = sift.detectAndCompute(gray, mask)
    places = np.asarray(cv2.KeyPoint.convert(found), np.float32).reshape(-1, 2)
    rows = np.sort(np.unique(np.rint(4 * places), axis=0, return_index=True)[1])
    response = np.array([found[row].response for row in rows], np.float32)
    if descriptors is None:
        descriptors = np.zeros((len(places), 128), np.float32)
    return Keypoints(places[rows], response, descriptors[rows])


@dataclass
class _Known(Rows):
    """Tracks that may be found again."""

    numbers: Numbers
    places: Places
    """(n, 2) where the points were last seen, in pixels."""
    seen: Numbers
    """(n,) frame in which they were last seen."""
    views: Numbers
    """(n,) how often they have been seen."""
    looks: Descriptors
    """(n, 128) SIFT descriptors where they were last seen."""
    patches: Patches
    """Their first appearance."""


class Matcher:
    """Matches the keypoints of frames that are shown to it one after the other."""

    def __init__(self) -> None:
        self._sift = make_sift(CONTRAST)
        self._born = 0
        self._index = 0
        self._known = self._new(Keypoints.none())
        self._past: deque[tuple[Numbers, Places]] = deque(maxlen=PATIENCE)

    def _new(self, found: Keypoints) -> _Known:
        count = len(found.places)
        numbers = self._born + np.arange(count)
        self._born += count
        return _Known(
            numbers, found.places, np.full(count, self._index), np.ones(count, np.int64),
            found.descriptors, Patches.unknown(count),
        )  # fmt: skip

    def step(self, gray: Bytes) -> tuple[Numbers, Places]:
        """Track numbers (n,), ascending, and places (n, 2) in the next frame (H, W)."""
        found = keypoints(self._sift, gray)
        cell = cell_size(gray, CELLS)
        found = found.kept(strongest_of_cells(found, cell, PER_CELL))
        old, new = matched(self._known.looks, found.descriptors)
        good = self._agreeing(self._known.kept(old), found.places[new], cell)
        again, new = self._known.kept(old[good]), new[good]
        picture = gray.astype(np.float32)
        again.places, alike = again.patches.refined(picture, found.places[new])
        again.looks, again.seen = found.descriptors[new], np.full(len(new), self._index)
        again.views += 1
        rest = np.ones(len(found.places), bool)
        rest[new[alike]] = False
        now = again.kept(alike)
        now = now.kept(np.argsort(now.numbers)).joined(self._new(found.kept(rest)))
        now.patches.learn(picture, now.places)
        # Recently lost tracks may come back.
        lost = ~np.isin(self._known.numbers, now.numbers) & (self._known.views > 1)
        lost &= self._index - self._known.seen < PATIENCE
        self._known = self._known.kept(lost).joined(now)
        self._past.appendleft((now.numbers, now.places))
        self._index += 1
        return now.numbers, now.places

    def _agreeing(self, known: _Known, places: Places, cell: int) -> Mask:
        """(m,) which matches fit the motion from the frame where their track was last seen."""
        good = np.zeros(len(places), bool)
        age = self._index - known.seen
        for each in np.unique(age):
            numbers, before = self._past[each - 1]
            candidates = np.nonzero((age == each) | good)[0]
            _, here, there = np.intersect1d(known.numbers[candidates], numbers, return_indices=True)
            rows = candidates[here]
            now, jump = places[rows], JUMP * each
            alike, judged = neighbour_consistency(before[there], now, cell, jump)
            # A wall alone does not determine the fundamental matrix of things in front of it.
            fits = alike | (epipolar(before[there], now) & ~judged)
            if fits.sum() >= max(MIN_SUPPORT, MIN_AGREEING * len(fits)):
                good[rows[fits & (age[rows] == each)]] = True
        return good


def matched(before: Descriptors, after: Descriptors) -> tuple[Ints, Ints]:
    """Return rows of matching descriptors (n, d) and (m, d): each other's best, by `MAX_RATIO`."""
    if len(before) < 2 or len(after) < 2:
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    squared = before @ after.T
    squared *= -2
    squared += (before**2).sum(axis=1)[:, None]
    squared += (after**2).sum(axis=1)
    rows = np.arange(len(before))
    best = squared.argmin(axis=1)
    first = squared[rows, best]
    squared[rows, best] = np.inf
    clear = np.maximum(first, 0) < MAX_RATIO**2 * squared.min(axis=1)
    squared[rows, best] = first
    old = np.nonzero(clear)[0]
    old = old[squared[:, best[old]].argmin(axis=0) == old]
    return old.astype(np.int32), best[old].astype(np.int32)


def epipolar(before: Places, after: Places) -> Mask:
    """Return (n,) which pairs fit one fundamental matrix; none where there are too few to find it."""
    if len(before) < 8:
        return np.zeros(len(before), bool)
    # OpenCV's newer estimators fail an assertion where all pairs move alike.
    matrix, fits = cv2.findFundamentalMat(before, after, cv2.FM_RANSAC, MAX_EPIPOLAR, 0.999, 500)
    return np.zeros(len(before), bool) if matrix is None else np.asarray(fits.ravel() == 1)


def strongest_of_cells(found: Keypoints, cell: int, count: int) -> NDArray[np.intp]:
    """Return rows (n,) of the `count` strongest keypoints of each cell, `cell` pixels wide."""
    column, row = (found.places // cell).astype(int).T
    number = row * (column.max(initial=0) + 1) + column
    order = np.lexsort([-found.response, number])
    place = np.arange(len(order)) - np.searchsorted(number[order], number[order])
    return np.sort(order[place < count])
