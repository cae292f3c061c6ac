"""Which pixels of a frame move by themselves: where its neighbours agree with no one place in the scene."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.progress import checkpoint, in_this_scope
from ..camera.reconstruction import Floats
from .plane_sweep import WORKERS, Bytes, Map, View

Mask = NDArray[np.bool_]

OFF = 1.5
"""Pixels by which the optical flow must leave what the depth predicts."""
BETTER = 1.0
"""Grey levels by which it must agree with the picture better."""
WINDOW = 7
"""Pixels over which pictures are compared."""
CLOSED = 9
"""Pixels across which holes in what moves are closed."""
SNAP = 8, 300.0
"""Of the guided filter that brings the mask to the picture's edges: pixels, squared grey levels."""
HIDDEN, HIDDEN_WINDOW = 20.0, 5
"""Grey levels by which a neighbour that shows something else differs, over so many pixels."""
MASKED = 85
"""Fourth channel of what the user says moves by itself: seen, but no depth is told from it."""
SMALLEST = 48
"""Pixels of the shorter side that optical flow needs."""
LEAST = 0.001
"""Share of the picture; what is smaller is an accident."""


def moving_pixels(own: Bytes, views: Sequence[View], inverse: Map, middle: float) -> Mask:
    """(h, w) bool: where most flows to neighbours on either side leave what inverse depth (h, w) predicts.

    What is hidden from one side is seen from the other, so it does not count. `middle` is an inverse depth at
    which the pictures are brought into register first, so that flows are short.
    """
    with ThreadPoolExecutor(WORKERS) as pool:
        votes = list(pool.map(in_this_scope(partial(_leaves, own, inverse, middle)), views))
    sides = sorted({view.side for view in views})
    agreed = np.ones(inverse.shape, bool)
    for side in sides:
        mine = [vote for vote, view in zip(votes, views, strict=True) if view.side == side]
        agreed &= np.mean(mine, axis=0) >= 0.5 if len(sides) > 1 else np.min(mine, axis=0) > 0
    whole = _whole(agreed)
    snapped = cv2.ximgproc.guidedFilter(own[..., :3], whole.astype(np.float32), *SNAP) > 0.5
    return _without_specks(snapped.astype(np.uint8))


def covered_pixels(own: Bytes, views: Sequence[View], inverse: Map, middle: float) -> Mask:
    """(h, w) bool: where some neighbour shows something else at the place that inverse depth (h, w) gives."""
    with ThreadPoolExecutor(WORKERS) as pool:
        worst = list(pool.map(in_this_scope(partial(_differs, own, inverse, middle)), views))
    return np.asarray(np.logical_or.reduce([np.zeros(inverse.shape, bool), *worst]))


def _differs(own: Bytes, inverse: Map, middle: float, view: View) -> Mask:
    checkpoint()
    seen, static = _still(view, inverse, middle)
    return (_mismatch(own, seen, static, HIDDEN_WINDOW) > HIDDEN) & _sees(seen, static, 0)


def _leaves(own: Bytes, inverse: Map, middle: float, view: View) -> Map:
    """(h, w) 1 where the flow to a neighbour contradicts the depth and fits the picture better."""
    seen, static = _still(view, inverse, middle)
    grey, other = (cv2.cvtColor(p[..., :3], cv2.COLOR_RGB2GRAY) for p in (own, seen))
    checkpoint()
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = search.calc(grey, other, None)  # type: ignore[call-overload]
    checkpoint()
    found = flow + _grid(inverse)
    off = np.linalg.norm(found - static, axis=2)
    worse = _mismatch(own, seen, static) - _mismatch(own, seen, found)
    return np.asarray((off > OFF) & (worse > BETTER) & _sees(seen, static), np.float32)


def _still(view: View, inverse: Map, middle: float) -> tuple[Bytes, Map]:
    """A neighbour's picture in register at one inverse depth, and where (h, w, 2) what stands still is."""
    height, width = inverse.shape
    move = np.linalg.inv(view.homography(middle)) @ view.move
    return view.warped(middle, width, height), _places(move, inverse - np.float32(middle))


def _sees(seen: Bytes, at: Map, above: int = MASKED) -> Mask:
    """(h, w) whether there is anything to compare with."""
    found = cv2.remap(cv2.extractChannel(seen, 3), at, None, cv2.INTER_NEAREST)  # type: ignore[call-overload]
    return np.asarray(found > above)


def _grid(inverse: Map) -> Map:
    """(h, w, 2) every pixel's own place."""
    height, width = inverse.shape
    across, down = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.dstack([across, down])


def _places(move: Floats, inverse: Map) -> Map:
    """(h, w, 2) places in the picture that is in register at one inverse depth, of another one."""
    m, (across, down) = move.astype(np.float32), np.moveaxis(_grid(inverse), 2, 0)
    x, y, z = (m[i, 0] * across + m[i, 1] * down + m[i, 2] for i in range(3))
    scale = 1 / np.maximum(1 + inverse * z, np.float32(0.05))
    places = np.dstack([(across + inverse * x) * scale, (down + inverse * y) * scale])
    return np.asarray(places, np.float32)


def _mismatch(own: Bytes, seen: Bytes, at: Map, window: int = WINDOW) -> Map:
    there = cv2.remap(seen, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    return np.asarray(cv2.blur(cv2.transform(cv2.absdiff(own, there), mean), (window, window)), np.float32)


def _whole(mask: Mask) -> Mask:
    """Without specks and small holes."""
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSED, CLOSED))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    return _without_specks(cv2.morphologyEx(opened, cv2.MORPH_CLOSE, shape))


def _without_specks(mask: Bytes) -> Mask:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= LEAST * mask.size
    large[0] = False
    return np.asarray(large[labels])
