"""How far a subject's mask is from the true one, in a frame and over time.

Masks are (H, W) bool. An outline is the pixels of a mask that have one of their four neighbours outside; the
picture's border is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.subjects.strokes import down

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

WITHIN = 2.0
"""Pixels that an outline may be off at 640x360: 0.3 % of the diagonal; Perazzi et al. 2016 allow 0.8 %."""
BAND = 12.0
"""Pixels on both sides of a subject's outline that have a score of their own."""
FARTHEST = 8.0
"""Pixels to which an outline's offset is counted: a leg that is missing is no wider for being long."""


def iou(mask: Mask, truth: Mask) -> float:
    """Intersection over union, 0 to 1; 1 where both are empty."""
    either = np.count_nonzero(mask | truth)
    return np.count_nonzero(mask & truth) / either if either else 1.0


def outline(mask: Mask) -> Mask:
    """(H, W) the pixels of a mask that have a neighbour outside."""
    wide = np.pad(mask, 1, mode="edge")
    inside = wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
    return np.asarray(mask & ~inside)


def outline_band(mask: Mask, reach: float = BAND) -> Mask:
    """(H, W) the pixels within `reach` pixels of a mask's outline."""
    return _distance(outline(mask)) <= reach


def boundary_f(mask: Mask, truth: Mask, within: float = WITHIN) -> float:
    """F-measure of the outline, 0 to 1: Perazzi et al. 2016, "A benchmark dataset and evaluation methodology
    for video object segmentation".

    The harmonic mean of the share of the mask's outline that is within so many pixels of the true one
    (precision) and the share of the true one within as many of the mask's (recall). 1 where neither has one.
    """
    found, wanted = outline(mask), outline(truth)
    if not found.any() or not wanted.any():
        return float(found.any() == wanted.any())
    precision = float(np.mean(_distance(wanted)[found] <= within))
    recall = float(np.mean(_distance(found)[wanted] <= within))
    return 2 * precision * recall / (precision + recall) if precision + recall else 0.0


def boiling(masks: Sequence[Mask], truths: Sequence[Mask], motions: Sequence[Floats]) -> float:
    """How far outlines move, in pixels a frame, other than the true ones: the mean change of their offset.

    The offset of a true outline's pixel is its distance to the mask's outline, to `FARTHEST` at most,
    positive where the mask reaches past it. It is compared along the true motion with that in the next frame:
    motions[t], (H, W, 2) in pixels right and down, leads from a pixel of frame t to where its surface is in
    t + 1, and the true outline's nearest pixel within `WITHIN` pixels of that is its next. An outline without
    one (it becomes hidden, or leaves the picture) does not count. So a mask that is always 2 pixels too wide
    costs nothing, and one that is so in every second frame costs 2.

    NaN where nothing counts.
    """
    total, count = 0.0, 0
    steps = zip(pairwise(masks), pairwise(truths), motions, strict=True)
    for (mask, next_mask), (truth, next_truth), motion in steps:
        edge, next_edge = outline(truth), outline(next_truth)
        if not edge.any() or not next_edge.any():
            continue
        distance, nearest = _nearest(next_edge)
        row, column = np.nonzero(edge)
        height, width = truth.shape
        to = np.rint(np.stack([row, column], axis=1) + motion[row, column, ::-1]).astype(int)
        inside = np.all((to >= 0) & (to < (height, width)), axis=1)
        row, column, to = row[inside], column[inside], to[inside]
        near = distance[tuple(to.T)] <= WITHIN
        after = tuple(nearest[tuple(to[near].T)].T)
        change = np.abs(_offset(next_mask)[after] - _offset(mask)[row[near], column[near]])
        total, count = total + float(change.sum()), count + change.size
    return total / count if count else float("nan")


def _offset(mask: Mask) -> Floats:
    """(H, W) distance to the mask's outline, positive inside, `FARTHEST` pixels at most."""
    away = np.minimum(_distance(outline(mask)), FARTHEST)
    return np.asarray(np.where(mask, away, -away))


def _distance(pixels: Mask) -> Floats:
    """(H, W) pixels to the nearest one of those; inf where there is none."""
    if not pixels.any():
        return np.full(pixels.shape, np.inf)
    apart = cv2.distanceTransform((~pixels).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(apart, np.float64)


def _nearest(pixels: Mask) -> tuple[Floats, NDArray[np.int64]]:
    """Distance (H, W) to the nearest one of those pixels, and (H, W, 2) its row and column."""
    _, label = cv2.distanceTransformWithLabels(
        (~pixels).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    places = np.zeros((label.max() + 1, 2), np.int64)
    places[label[pixels]] = np.argwhere(pixels)
    return _distance(pixels), places[label]


def stroke(mask: Mask, places: int) -> Floats:
    """(n, 2) what a user would touch: of bands of even height, top to bottom, the innermost pixel of each.

    In shares of the picture's size, right and down; bands that have no pixel are left out.
    """
    return np.array(down(mask, places)).reshape(-1, 2)
