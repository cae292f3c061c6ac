"""Storage of a clip's highlights beside its depth: clipped light, and estimates from rims.

Results are equal whether they are computed or read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..depth.depth_store import LONGEST_SIDE, DepthStore, decoded, encoded
from ..warp.highlight_kinds import RADIANCES, Lamps
from ..warp.highlights import LostLight

LOST, LAMPS = "lost", "lamps"
"""Kinds of files."""
BRIGHTEST = 60000.0
"""Largest linear light of a half float."""
ROW = 1024
"""Pixels in a row of the picture that stores light."""


def named(kind: str, frame: int, threshold: float) -> str:
    """Return the name of a frame's file of a kind, at a threshold."""
    return f"{kind}-{threshold:.6g}-{frame:06d}"


def size(found: Lamps | LostLight) -> int:
    """Return the size in memory in bytes."""
    arrays = (value for value in vars(found).values() if isinstance(value, np.ndarray))
    return 1 + sum(array.nbytes for array in arrays)


def rounded(lost: LostLight) -> LostLight:
    """Round to the stored precision."""
    return LostLight(lost.pixel, _halves(lost.light).astype(np.float32))


def keep_lost(store: DepthStore, name: str, lost: LostLight, shape: tuple[int, int]) -> None:
    """Store a result of `rounded` for a picture (h, w)."""
    mask = np.zeros(shape, np.uint8)
    mask.ravel()[lost.pixel] = 1
    bits = _halves(lost.light).T.ravel().view(np.uint16)
    rows = np.zeros((max(1, -(-len(bits) // ROW)), ROW), np.uint16)
    rows.ravel()[: len(bits)] = bits
    store.write(name, {"where": encoded(mask), "light": encoded(rows)})


def read_lost(store: DepthStore, name: str, shape: tuple[int, int]) -> LostLight | None:
    """Read the clipped light of a picture (h, w); None if it is missing or damaged."""
    parts = store.read(name, ("where", "light"))
    mask, rows = (None, None) if parts is None else (decoded(part, LONGEST_SIDE) for part in parts.values())
    if mask is None or rows is None or mask.shape != shape or rows.dtype != np.uint16:
        return None
    pixel = np.flatnonzero(mask)
    if not 3 * len(pixel) <= rows.size < 3 * len(pixel) + 2 * ROW:
        return None
    bits = np.asarray(rows, np.uint16).ravel()[: 3 * len(pixel)].reshape(3, -1)
    light = bits.view(np.float16).T.astype(np.float32)
    return LostLight(pixel, light) if np.isfinite(light).all() and (light >= 0).all() else None


def lamps_of(
    store: DepthStore | None,
    frames: Sequence[int],
    name: Callable[[int], str],
    find: Callable[[int], Lamps],
) -> dict[int, Lamps]:
    """Return the estimates from rims in frames, stored or computed.

    `name` returns a frame's name in the store, `find` computes its estimates. Frames that another process is
    working on are left to it; see `DepthStore.made`.
    """
    if store is None:
        return {frame: find(frame) for frame in frames}

    def read(frame: int) -> Lamps | None:
        parts = store.read(name(frame), ("centre", "area", "evidence", "tint"))
        if parts is None:
            return None
        shapes = [part.shape for part in parts.values()]
        count = parts["area"].size
        if shapes != [(count, 2), (count,), (count, len(RADIANCES)), (count, 3)]:
            return None
        found = Lamps(*(np.asarray(part, np.float32) for part in parts.values()))
        return found if all(np.isfinite(part).all() for part in vars(found).values()) else None

    def made(frame: int) -> Lamps:
        found = find(frame)
        store.write(name(frame), dict(vars(found)))
        return found

    return store.made(frames, name, read, made)


def _halves(light: NDArray[np.float32]) -> NDArray[np.float16]:
    """Convert light (k, 3) to half floats, accurate to 0.05 %."""
    return np.ascontiguousarray(np.minimum(light, BRIGHTEST).astype(np.float16))
