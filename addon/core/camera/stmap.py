"""STMaps: pictures with the places where another picture is sampled, for compositing programs.

Red is u, from 0 at the left edge of the other picture to 1 at its right edge; green is v, from 0 at its
bottom edge to 1 at its top edge. The centre of the first of w pixels is at 0.5 / w. Blue is 0.
"""

import numpy as np

from ..base.arrays import Floats, Map, pixel_centres
from .canvas import Canvas


def undistort_map(canvas: Canvas) -> Map:
    """Return u and v (h, w, 2) of the source frame for each pixel of the canvas.

    The canvas has overscan: they are below 0 and over 1 where the lens saw nothing.
    """
    at = canvas.features_to_source(pixel_centres(canvas.pinhole.width, canvas.pinhole.height))
    return _normalised(at, canvas.camera.width, canvas.camera.height)


def redistort_map(canvas: Canvas) -> Map:
    """Return (H, W, 2) u and v of the canvas for each pixel of the source frame."""
    at = canvas.features_from_source(pixel_centres(canvas.camera.width, canvas.camera.height))
    return _normalised(at, canvas.pinhole.width, canvas.pinhole.height)


def channels(stmap: Map) -> dict[str, Map]:
    """Return the channels of an EXR of a map (h, w, 2)."""
    return {"R": stmap[..., 0], "G": stmap[..., 1], "B": np.zeros(stmap.shape[:2], np.float32)}


def _normalised(xy: Floats, width: int, height: int) -> Map:
    """Return u and v of pixels (h, w, 2) of a picture."""
    return np.stack([xy[..., 0] / width, 1 - xy[..., 1] / height], axis=-1).astype(np.float32)
