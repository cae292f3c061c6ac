"""Which pixels of a frame move by themselves: where its neighbours agree with no one place in the scene."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.limits import threads
from ..base.progress import checkpoint, in_this_scope
from .plane_sweep import View

MASKED = 85
"""Fourth channel of a picture where the user says that something moves: seen, but no depth comes from it."""


@dataclass(frozen=True)
class MotionOptions:
    """When a pixel moves by itself: where its optical flow leaves what its depth predicts, and for good."""

    least_residual: float = 1.5
    """Pixels between the optical flow and the motion that the depth predicts. By eye."""
    least_improvement: float = 1.0
    """Grey levels by which the flow must match the picture better than the depth does. By eye."""
    match_window: int = 7
    """Pixels across the window over which those matches are compared. By eye."""
    closing: int = 9
    """Pixels across the morphological closing of what moves. By eye."""
    guide_radius: int = 8
    """Pixels: radius of the guided filter that brings the mask to the picture's edges. By eye."""
    guide_epsilon: float = 300.0
    """Squared grey levels that count as one surface in that guided filter. By eye."""
    occluding_mismatch: float = 20.0
    """Grey levels by which a neighbour that shows something else at a place differs. By eye."""
    occluding_window: int = 5
    """Pixels across the window over which that mismatch is taken. By eye."""
    least_side: int = 48
    """Pixels of the shorter side below which optical flow is not computed: OpenCV's fails on small
    pictures."""
    least_area: float = 0.001
    """Share of the picture; a smaller moving object is noise. By eye."""


def moving_pixels(
    reference: Bytes, views: Sequence[View], inverse: Map, middle: float, options: MotionOptions
) -> Mask:
    """(h, w) bool: where most flows from a frame (h, w, 4) to neighbours on either side leave what inverse
    depth (h, w) predicts.

    What is hidden from one side is seen from the other, so it does not count. `middle` is an inverse depth at
    which the pictures are brought into register first, so that flows are short (Irani and Anandan, "A unified
    approach to moving object detection in 2D and 3D scenes", 1998: plane plus parallax).
    """
    vote = partial(_leaves, reference, inverse, middle, options)
    with ThreadPoolExecutor(threads()) as pool:
        votes = list(pool.map(in_this_scope(vote), views))
    sides = sorted({view.side for view in views})
    agreed = np.ones(inverse.shape, bool)
    for side in sides:
        mine = [vote for vote, view in zip(votes, views, strict=True) if view.side == side]
        agreed &= np.mean(mine, axis=0) >= 0.5 if len(sides) > 1 else np.min(mine, axis=0) > 0
    refined = cv2.ximgproc.guidedFilter(
        reference[..., :3], _closed(agreed, options).astype(np.float32),
        options.guide_radius, options.guide_epsilon,
    )  # fmt: skip
    return _without_specks((refined > 0.5).astype(np.uint8), options)


def occluding_pixels(
    reference: Bytes, views: Sequence[View], inverse: Map, middle: float, options: MotionOptions
) -> Mask:
    """(h, w) bool: where some neighbour shows something else than a frame (h, w, 4) at the place that inverse
    depth (h, w) gives; `middle` is an inverse depth at which the pictures are brought into register first."""
    differs = partial(_differs, reference, inverse, middle, options)
    with ThreadPoolExecutor(threads()) as pool:
        worst = list(pool.map(in_this_scope(differs), views))
    return np.asarray(np.logical_or.reduce([np.zeros(inverse.shape, bool), *worst]))


def _differs(reference: Bytes, inverse: Map, middle: float, options: MotionOptions, view: View) -> Mask:
    """(h, w) where a neighbour shows something else at the place that the depth gives."""
    checkpoint()
    seen, static = _registered(view, inverse, middle)
    mismatch = _mismatch(reference, seen, static, options.occluding_window)
    return (mismatch > options.occluding_mismatch) & _sees(seen, static, 0)


def _leaves(reference: Bytes, inverse: Map, middle: float, options: MotionOptions, view: View) -> Map:
    """(h, w) 1 where the flow to a neighbour contradicts the depth and fits the picture better."""
    seen, static = _registered(view, inverse, middle)
    grey, other = (cv2.cvtColor(p[..., :3], cv2.COLOR_RGB2GRAY) for p in (reference, seen))
    checkpoint()
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = search.calc(grey, other, None)  # type: ignore[call-overload]
    checkpoint()
    found = flow + _grid(inverse)
    residual = np.linalg.norm(found - static, axis=2)
    by_depth, by_flow = (_mismatch(reference, seen, at, options.match_window) for at in (static, found))
    leaves = (residual > options.least_residual) & (by_depth - by_flow > options.least_improvement)
    return np.asarray(leaves & _sees(seen, static), np.float32)


def _registered(view: View, inverse: Map, middle: float) -> tuple[Bytes, Map]:
    """A neighbour's picture in register at one inverse depth, and where (h, w, 2) what stands still is."""
    height, width = inverse.shape
    parallax = np.linalg.inv(view.homography(middle)) @ view.parallax_term
    return view.warped(middle, width, height), _places(parallax, inverse - np.float32(middle))


def _sees(seen: Bytes, at: Map, above: int = MASKED) -> Mask:
    """(h, w) whether a picture (h, w, 4) has a fourth channel of more than that at places (h, w, 2)."""
    found = cv2.remap(cv2.extractChannel(seen, 3), at, None, cv2.INTER_NEAREST)  # type: ignore[call-overload]
    return np.asarray(found > above)


def _grid(inverse: Map) -> Map:
    """(h, w, 2) every pixel's own place."""
    height, width = inverse.shape
    across, down = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.dstack([across, down])


def _places(parallax: Floats, inverse: Map) -> Map:
    """(h, w, 2) places in a neighbour's picture that is in register at one inverse depth, of inverse depths
    (h, w) relative to that, by the parallax term (3, 3)."""
    m, (across, down) = parallax.astype(np.float32), np.moveaxis(_grid(inverse), 2, 0)
    x, y, z = (m[i, 0] * across + m[i, 1] * down + m[i, 2] for i in range(3))
    scale = 1 / np.maximum(1 + inverse * z, np.float32(0.05))
    places = np.dstack([(across + inverse * x) * scale, (down + inverse * y) * scale])
    return np.asarray(places, np.float32)


def _mismatch(reference: Bytes, seen: Bytes, at: Map, window: int) -> Map:
    """(h, w) mean absolute difference in grey levels of a frame and a picture at places (h, w, 2)."""
    there = cv2.remap(seen, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    return np.asarray(
        cv2.blur(cv2.transform(cv2.absdiff(reference, there), mean), (window, window)), np.float32
    )


def _closed(mask: Mask, options: MotionOptions) -> Mask:
    """A mask (h, w) without specks and small holes."""
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (options.closing,) * 2)
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    return _without_specks(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, shape), options)


def _without_specks(mask: Bytes, options: MotionOptions) -> Mask:
    """A mask (h, w) without connected parts that are too small."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= options.least_area * mask.size
    large[0] = False
    return np.asarray(large[labels])
