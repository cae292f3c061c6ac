"""Storage of a clip's highlights beside its depth: clipped light, and estimates from rims."""

from __future__ import annotations

from dataclasses import fields
from functools import partial

import numpy as np

from ..base.store import Arrays, Entry
from ..warp.highlight_kinds import RADIANCES, Lamps
from ..warp.highlights import LostLight

BRIGHTEST = 60000.0
"""Largest linear light of a half float."""
ROW = 1024
"""Pixels in a row of the picture that stores light."""


def size(found: Lamps | LostLight) -> int:
    """Return the size in memory in bytes."""
    arrays = (value for value in vars(found).values() if isinstance(value, np.ndarray))
    return 1 + sum(array.nbytes for array in arrays)


def lost_name(frame: int, threshold: float) -> str:
    """Return the name of a frame's `lost_entry`."""
    return f"lost-{threshold:.6g}-{frame:06d}"


def lost_entry(frame: int, threshold: float, shape: tuple[int, ...]) -> Entry[LostLight]:
    """Return the entry of the clipped light of a frame's picture (h, w) at a threshold, in half floats."""
    coding = partial(_encoded, shape), partial(_decoded, shape)
    return Entry(lost_name(frame, threshold), ("where", "light"), *coding, rounds=True)


def _encoded(shape: tuple[int, ...], lost: LostLight) -> Arrays:
    mask = np.zeros(shape, np.uint8)
    mask.ravel()[lost.pixel] = 1
    # Accurate to 0.05 %.
    halves = np.ascontiguousarray(np.minimum(lost.light, BRIGHTEST).astype(np.float16))
    bits = halves.T.ravel().view(np.uint16)
    rows = np.zeros((max(1, -(-len(bits) // ROW)), ROW), np.uint16)
    rows.ravel()[: len(bits)] = bits
    return {"where": mask, "light": rows}


def _decoded(shape: tuple[int, ...], parts: Arrays) -> LostLight | None:
    mask, rows = parts["where"], parts["light"]
    if mask.shape != shape or rows.dtype != np.uint16:
        return None
    pixel = np.flatnonzero(mask)
    if not 3 * len(pixel) <= rows.size < 3 * len(pixel) + 2 * ROW:
        return None
    bits = rows.ravel()[: 3 * len(pixel)].reshape(3, -1)
    light = bits.view(np.float16).T.astype(np.float32)
    return LostLight(pixel, light) if np.isfinite(light).all() and (light >= 0).all() else None


def lamps_entry(frame: int, threshold: float) -> Entry[Lamps]:
    """Return the entry of a frame's estimates from rims at a threshold."""

    def decode(parts: Arrays) -> Lamps | None:
        count = parts["area"].size
        shapes = [part.shape for part in parts.values()]
        if shapes != [(count, 2), (count,), (count, len(RADIANCES)), (count, 3)]:
            return None
        found = Lamps(*(np.asarray(part, np.float32) for part in parts.values()))
        return found if all(np.isfinite(part).all() for part in vars(found).values()) else None

    names = tuple(field.name for field in fields(Lamps))
    return Entry(f"lamps-{threshold:.6g}-{frame:06d}", names, lambda found: dict(vars(found)), decode)
