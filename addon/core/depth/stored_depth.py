"""Depth of frames as it is kept in a `Store`: inverse depth in 12 bits, and confidence in 4."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Map
from ..base.store import Arrays, Entry
from ..camera.intrinsics import Intrinsics
from .multi_view_stereo import DenseDepth

FINEST = 4095
"""Steps from a frame's least inverse depth to its largest: 0.02 pixels where a disc has 96. With 65535 a
file is twice as large, of noise."""
UNKNOWN = FINEST + 1
"""Instead of a step, where nothing is known."""
MAPS: dict[str, type[np.generic]] = {
    "inverse": np.uint16, "confidence": np.uint8, "moving": np.uint8, "past": np.uint16,
}  # fmt: skip
"""Pictures in a frame's file, and their types."""
SUREST = 15
"""Steps of confidence from 0 to 1; it is compared with thresholds only."""


def depth_entry(kind: str, frame: int, pinhole: Intrinsics) -> Entry[DenseDepth]:
    """Return the entry of a frame's depth, of one of the store's kinds, as a pinhole sees it."""
    longest = 3 * max(pinhole.width, pinhole.height)
    parts, decode = (*MAPS, "range", "past_range"), partial(_decoded, frame, pinhole)
    return Entry(f"{kind}-{frame:06d}", parts, _encoded, decode, longest, rounds=True)


def _encoded(depth: DenseDepth) -> Arrays:
    beyond = depth.past_border
    if beyond is None:
        beyond = np.full(depth.inverse_depth.shape, np.nan, np.float32)
    (inverse, span), (past, past_span) = _in_steps(depth.inverse_depth), _in_steps(beyond)
    sure = np.rint(SUREST * depth.confidence).astype(np.uint8)
    return {
        "inverse": inverse, "confidence": sure, "moving": depth.moving.astype(np.uint8), "past": past,
        "range": span, "past_range": past_span,
    }  # fmt: skip


def _decoded(frame: int, pinhole: Intrinsics, parts: Arrays) -> DenseDepth | None:
    shape, past = (pinhole.height, pinhole.width), parts["past"].shape
    if any(parts[name].dtype != kind for name, kind in MAPS.items()):
        return None
    if any(parts[name].shape != shape for name in ("inverse", "confidence", "moving")):
        return None
    around = past[0] - shape[0]
    if around < 0 or around % 2 or past != (shape[0] + around, shape[1] + around):
        return None
    if any(parts[name].shape != (2,) for name in ("range", "past_range")):
        return None
    return DenseDepth(
        frame, _from_steps(parts["inverse"], parts["range"]),
        parts["confidence"].astype(np.float32) / np.float32(SUREST), parts["moving"].astype(bool), pinhole,
        _from_steps(parts["past"], parts["past_range"]),
    )  # fmt: skip


def _in_steps(inverse_depth: Map) -> tuple[NDArray[np.uint16], Floats]:
    """Return inverse depth (h, w), NaN in unknown pixels, in steps; and the least one and a step (2,)."""
    known = ~np.isnan(inverse_depth)
    low = float(np.min(inverse_depth, initial=np.inf, where=known)) if known.any() else 0.0
    high = float(np.max(inverse_depth, initial=low, where=known))
    step = max((high - low) / FINEST, float(np.finfo(np.float32).tiny))
    steps = np.rint((inverse_depth - low) / step).clip(0, FINEST)
    return np.where(known, steps, UNKNOWN).astype(np.uint16), np.array([low, step])


def _from_steps(steps: NDArray[np.generic], span: NDArray[np.generic]) -> Map:
    """Return the inverse depth (h, w) of `_in_steps`."""
    low, step = (np.float32(each) for each in span.tolist())
    return np.where(steps == UNKNOWN, np.float32(np.nan), low + np.asarray(steps, np.uint16) * step)
