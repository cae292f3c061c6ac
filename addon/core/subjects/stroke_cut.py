"""What strokes mark in the frame that they are drawn in."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Map, Mask
from ..base.progress import checkpoint
from .parts import touching
from .segmentation import SegmentationOptions, segmented


@dataclass(frozen=True)
class CarryOptions:
    """How a marked subject is cut out, and carried from frame to frame."""

    width: float = 0.01
    """Width of a stroke, as share of the long side."""
    around: float = 0.5
    """Of the larger side of the strokes' bounding box, beyond which is background; see `least_around`."""
    least_around: float = 0.12
    """Share of the long side around strokes that may be the subject at least. By eye."""
    iterations: int = 5
    """Of GrabCut in the frame with the stroke. By eye."""
    moves: tuple[float, float] = (0.2, 0.6)
    """Share of a subject that contradicts the static scene up to which what agrees with that scene may be the
    subject, and from which on it is not. By eye."""
    band: float = 0.012
    """Share of the long side, on either side of the carried outline, in which the outline may lie. By eye."""
    leap: float = 0.06
    """Share of the long side beyond the carried outline that a limb may reach in a frame, where it
    contradicts the static scene. By eye."""
    carried: float = 3.0
    """Log-odds of a pixel well within what flow carries; well outside with minus. By eye."""
    carried_moving: float = 0.7
    """The same of a subject that contradicts the static scene, which flow often confuses with it. By eye."""
    told: float = 1.5
    """Times as much that evidence of the static scene counts as where subjects are found. By eye."""
    colour: float = 1.8
    """Log-odds that colours alone may add. By eye."""
    lost: float = 0.15
    """Share of the area that it had, with less of which it is hidden. By eye."""
    whole: float = 0.8
    """Share of the area that it had, from which on it is seen whole. By eye."""
    island: float = 0.03
    """Share of the largest part of it, with less of which a part that does not contradict the static scene
    is dropped: what flow sticks to when the subject leaves it. By eye."""
    another: float = 0.2
    """Share of the largest part of it, from which on a part that hangs together may be another subject. By
    eye."""
    unsure: float = 0.75
    """Intersection over union with what was carried, below which a frame is unsure. By eye."""


def cut_out(
    picture: Bytes,
    strokes: tuple[Mask, Mask],
    evidence: tuple[Map, Map] | None,
    options: CarryOptions,
    segmentation: SegmentationOptions,
) -> Map:
    """(h, w) probability of what strokes that add and take away (h, w) mark in a picture (h, w, 3) of
    display-encoded RGB.

    `evidence` is log-odds (h, w) that a pixel contradicts the static scene and their weights (h, w), where
    they are known. If they say that what is under the strokes moves, they tell its outline; else its colours
    do (Rother et al., "GrabCut", 2004).
    """
    adds, takes = strokes
    marked = np.where(adds, np.float32(1), 0) - np.where(takes, np.float32(1), 0)
    if evidence is not None:
        odds, weight = evidence
        if contradicts(adds, evidence, options):
            odds = np.asarray(odds + options.carried * marked, np.float32)
            weight = np.maximum(weight, np.abs(marked))
            share = segmented(picture, odds, weight, segmentation)
            return np.where(touching(share > 0.5, adds) & ~takes, share, 0).astype(np.float32)
    return (_by_colour(picture, adds, takes, options) & ~takes).astype(np.float32)


def contradicts(adds: Mask, evidence: tuple[Map, Map], options: CarryOptions) -> bool:
    """Whether what is under strokes (h, w) contradicts the static scene, by its log-odds (h, w) and their
    weights (h, w)."""
    odds, weight = evidence
    known = float((weight > 0.3)[adds].sum())
    # Lines cross gaps between legs.
    return float((weight * odds > 0.5)[adds].sum()) > float(np.mean(options.moves)) * max(known, 1.0)


def _by_colour(picture: Bytes, adds: Mask, takes: Mask, options: CarryOptions) -> Mask:
    """(h, w) what is like the pixels that are added (h, w), near them, and unlike others."""
    row, column = np.nonzero(adds)
    if not len(row):
        return adds
    reach = max(options.around * max(np.ptp(row), np.ptp(column)), options.least_around * max(adds.shape))
    away = cv2.distanceTransform((~adds).astype(np.uint8), cv2.DIST_L2, 5)
    trimap = np.where(away <= reach, np.uint8(cv2.GC_PR_BGD), np.uint8(cv2.GC_BGD))
    trimap[adds], trimap[takes] = cv2.GC_FGD, cv2.GC_BGD
    if not (trimap != cv2.GC_FGD).any():
        return adds
    checkpoint()
    cv2.setRNGSeed(0)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    bgr = np.ascontiguousarray(picture[..., ::-1])
    cv2.grabCut(bgr, trimap, None, *models, options.iterations, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    mask = (trimap == cv2.GC_FGD) | (trimap == cv2.GC_PR_FGD)
    return touching(cv2.medianBlur(mask.astype(np.uint8), 3) > 0, adds) | adds
