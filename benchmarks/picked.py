"""The focus that a click has without dense depth."""

from __future__ import annotations

from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.sparse import frame_features
from addon.core.focus.focus import Focus
from addon.core.focus.picking import check_place, pick_features


def pick(reconstruction: Reconstruction, frame: int, x: float, y: float) -> Focus:
    """The feature points for a click at fractions of a frame's width and height, as of `pick_features`."""
    check_place(reconstruction, frame, x, y)
    canvas = reconstruction.canvas(frame)
    return pick_features(frame_features(reconstruction, frame, canvas), canvas, x, y)
