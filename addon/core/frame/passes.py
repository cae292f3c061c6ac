"""Passes of a frame for compositing: depth, circle of confusion, and focus.

All are (H, W) float32 of the sharp frame, in its own geometry; neighbouring pixels are not mixed.
"""

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..camera.canvas import Canvas
from .frame import Frame
from .inspection import inverse_depth

INFINITE = 1e10
"""Scene units that stand for infinity, as in Blender's own Depth pass."""


def depth(frame: Frame) -> Map:
    """Return the distance (H, W) along the camera's axis in scene units, `INFINITE` if unknown."""
    return distances(in_source(inverse_depth(frame), frame.views.canvas))


def distances(inverse: Map) -> Map:
    """Convert inverse depths (H, W) to scene units, `INFINITE` where they are NaN or not positive."""
    far = ~(inverse > 1 / INFINITE)
    return np.where(far, np.float32(INFINITE), 1 / np.where(far, 1, inverse)).astype(np.float32)


def circle_of_confusion(frame: Frame) -> Map:
    """Return signed diameters (H, W) of blur discs in pixels, positive in front of the focal plane.

    Unknown pixels have the disc of infinity.
    """
    lens = frame.views.lens
    signed = lens.blur_disc(lens.rectified_raster(np.nan_to_num(inverse_depth(frame)).astype(np.float32)))
    return in_source(signed, frame.views.canvas)


def in_focus(frame: Frame) -> Map:
    """Return (H, W) 1 up to the acceptable circle of confusion, falling to 0 at twice its diameter."""
    size = np.abs(circle_of_confusion(frame)) / frame.views.lens.acceptable_disc
    return np.asarray(np.clip(2 - size, 0, 1), np.float32)


def in_source(values: Floats | Map, canvas: Canvas) -> Map:
    """Resample values (h, w) of the canvas in the source frame's geometry (H, W), without interpolation."""
    if not canvas.camera.is_distorted:
        return values.astype(np.float32)
    values, at = values.astype(np.float32), canvas.source_map()
    taken = cv2.remap(values, at, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    return np.asarray(taken, np.float32)
