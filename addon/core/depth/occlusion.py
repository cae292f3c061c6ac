"""Which pixels of a frame show something else in its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.limits import threads
from ..base.progress import checkpoint, in_this_scope
from .plane_sweep import View

MASKED = 85
"""Fourth channel of a picture where the user says that something moves: seen, but no depth comes from it."""
MISMATCH, WINDOW = 20.0, 5
"""Grey levels by which a neighbour that shows something else at a place differs, and pixels across the window
over which that is taken. By eye."""


def occluding_pixels(reference: Bytes, views: Sequence[View], inverse: Map, middle: float) -> Mask:
    """(h, w) bool: where some neighbour shows something else than a frame (h, w, 4) at the place that inverse
    depth (h, w) gives; `middle` is an inverse depth at which the pictures are brought into register first."""
    differs = partial(_differs, reference, inverse, middle)
    with ThreadPoolExecutor(threads()) as pool:
        worst = list(pool.map(in_this_scope(differs), views))
    return np.asarray(np.logical_or.reduce([np.zeros(inverse.shape, bool), *worst]))


def _differs(reference: Bytes, inverse: Map, middle: float, view: View) -> Mask:
    """(h, w) where a neighbour shows something else at the place that the depth gives."""
    checkpoint()
    seen, static = _registered(view, inverse, middle)
    known = cv2.remap(cv2.extractChannel(seen, 3), static, None, cv2.INTER_NEAREST) > 0  # type: ignore[call-overload]
    return np.asarray((_mismatch(reference, seen, static) > MISMATCH) & known)


def _registered(view: View, inverse: Map, middle: float) -> tuple[Bytes, Map]:
    """A neighbour's picture in register at one inverse depth, and where (h, w, 2) what stands still is."""
    height, width = inverse.shape
    parallax = np.linalg.inv(view.homography(middle)) @ view.parallax_term
    return view.warped(middle, width, height), _places(parallax, inverse - np.float32(middle))


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


def _mismatch(reference: Bytes, seen: Bytes, at: Map) -> Map:
    """(h, w) mean absolute difference in grey levels of a frame and a picture at places (h, w, 2)."""
    there = cv2.remap(seen, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    return np.asarray(
        cv2.blur(cv2.transform(cv2.absdiff(reference, there), mean), (WINDOW, WINDOW)), np.float32
    )
