"""Which pixels of a frame move by themselves: where its neighbours agree with no one place in the scene."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
from numpy.typing import NDArray

from .dense_sweep import WORKERS, Bytes, Map, View
from .reconstruction import Floats

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
        votes = list(pool.map(lambda view: _leaves(own, view, inverse, middle), views))
    sides = sorted({view.side for view in views})
    agreed = np.ones(inverse.shape, bool)
    for side in sides:
        mine = [vote for vote, view in zip(votes, views, strict=True) if view.side == side]
        agreed &= np.mean(mine, axis=0) >= 0.5 if len(sides) > 1 else np.min(mine, axis=0) > 0
    whole = _whole(agreed)
    return np.asarray(cv2.ximgproc.guidedFilter(own[..., :3], whole.astype(np.float32), *SNAP) > 0.5)


def _leaves(own: Bytes, view: View, inverse: Map, middle: float) -> Map:
    """(h, w) 1 where the flow to a neighbour contradicts the depth and fits the picture better."""
    height, width = inverse.shape
    seen = view.warped(middle, width, height)
    grey, other = (cv2.cvtColor(p[..., :3], cv2.COLOR_RGB2GRAY) for p in (own, seen))
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = search.calc(grey, other, None)  # type: ignore[call-overload]
    across, down = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    static = _places(
        np.linalg.inv(view.homography(middle)) @ view.move, inverse - np.float32(middle), across, down
    )
    found = flow + np.dstack([across, down])
    off = np.linalg.norm(found - static, axis=2)
    worse = _mismatch(own, seen, static) - _mismatch(own, seen, found)
    valid = cv2.remap(cv2.extractChannel(seen, 3), static, None, cv2.INTER_NEAREST) > 0  # type: ignore[call-overload]
    return np.asarray((off > OFF) & (worse > BETTER) & valid, np.float32)


def _places(move: Floats, inverse: Map, across: Map, down: Map) -> Map:
    """(h, w, 2) places in the picture that is in register at one inverse depth, of another one."""
    m = move.astype(np.float32)
    x, y, z = (m[i, 0] * across + m[i, 1] * down + m[i, 2] for i in range(3))
    scale = 1 / np.maximum(1 + inverse * z, np.float32(0.05))
    places = np.dstack([(across + inverse * x) * scale, (down + inverse * y) * scale])
    return np.asarray(places, np.float32)


def _mismatch(own: Bytes, seen: Bytes, at: Map) -> Map:
    there = cv2.remap(seen, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    return np.asarray(cv2.blur(cv2.transform(cv2.absdiff(own, there), mean), (WINDOW, WINDOW)), np.float32)


def _whole(mask: Mask) -> Mask:
    """Without specks and holes."""
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (CLOSED, CLOSED))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, small)
    closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, shape)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= LEAST * mask.size
    large[0] = False
    return np.asarray(large[labels])
