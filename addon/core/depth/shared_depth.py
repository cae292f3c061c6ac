"""Depth that is found once: kept, and shared with other processes that work on the same clip."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..camera.intrinsics import Intrinsics
from .depth_store import DepthStore, KeptDepth
from .multi_view_stereo import DenseDepth

Pinhole = Callable[[int], Intrinsics]
"""The pinhole that a frame's depth is seen through."""


def kept_depth(store: DepthStore | None, kind: str, frame: int, pinhole: Pinhole) -> DenseDepth | None:
    """Return the depth of a frame, of one of the store's kinds, as it is kept; None where it is not."""
    if store is None:
        return None
    through = pinhole(frame)
    kept = store.depth(frame, (through.height, through.width), kind)
    return None if kept is None else _dense(frame, kept, through)


def not_kept(store: DepthStore | None, kind: str, frames: Sequence[int], pinhole: Pinhole) -> list[int]:
    """Return those of some frames whose depth, of one of the store's kinds, would have to be found."""
    return [frame for frame in frames if kept_depth(store, kind, frame, pinhole) is None]


def found_once(
    store: DepthStore | None,
    kind: str,
    frames: Sequence[int],
    pinhole: Pinhole,
    find: Callable[[int], DenseDepth],
) -> dict[int, DenseDepth]:
    """Return the depth of frames of one of the store's kinds, kept or found.

    Frames that another process is working on are left to it; see `DepthStore.made`.
    """

    def made(frame: int) -> DenseDepth:
        found = find(frame)
        kept = KeptDepth.of(found.inverse_depth, found.confidence, found.moving, found.past_border)
        if store:
            store.keep_depth(frame, kept, kind)
        return _dense(frame, kept, pinhole(frame))

    if not store:
        return {frame: made(frame) for frame in frames}
    return store.made(
        frames,
        lambda frame: f"{kind}-{frame:06d}",
        lambda frame: kept_depth(store, kind, frame, pinhole),
        made,
    )


def _dense(frame: int, kept: KeptDepth, pinhole: Intrinsics) -> DenseDepth:
    return DenseDepth(frame, kept.inverse_depth, kept.confidence, kept.moving, pinhole, kept.past_border)
