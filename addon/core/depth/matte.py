"""The user's matte of what moves by itself, at a frame's own size, and the depth that ends at its outline."""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Floats, Map, Mask
from ..base.nearest_fill import of_nearest
from ..camera.canvas import Canvas
from .source import FAINTEST

VOTES = 2
"""Pixels of the size that depth is found at, within which upsampling may mistake one surface for another: it
chooses among the four around."""


def opacity_over(canvas: Canvas, mask: Map | Mask) -> Map:
    """(H, W) in [0, 1] over a canvas, of opacities (h, w) over its source frame at any size."""
    size = (canvas.camera.width, canvas.camera.height)
    how = cv2.INTER_AREA if mask.shape[1] > size[0] else cv2.INTER_LINEAR
    share = cv2.resize(np.asarray(mask, np.float32), size, interpolation=how)
    if canvas.camera.is_distorted:
        share = canvas.from_source(np.dstack([share] * 4))[..., 0]
    return np.asarray(np.clip(share, 0, 1), np.float32)


def outlined(inverse: Floats, found: Map, moving: Mask, opacity: Map) -> Floats:
    """Inverse depth (H, W), upsampled from what was `found` (h, w), with the outline of a matte (H, W).

    What the matte covers in part has the depth of what moves (h, w) there, what is beside the depth of what
    stands still: upsampling by colour tells neither of hair.
    """
    height, width = opacity.shape
    covered = opacity > FAINTEST
    small = cv2.resize(covered.astype(np.float32), found.shape[::-1], interpolation=cv2.INTER_AREA) > 0
    masked = moving & small
    if not masked.any() or masked.all():
        return inverse
    size = (width, height)

    def of(seeds: Mask) -> Map:
        return np.asarray(cv2.resize(of_nearest(found, seeds)[0], size, interpolation=cv2.INTER_NEAREST))

    near = of(masked)
    reach = 2 * int(np.ceil(VOTES * width / found.shape[1])) + 1
    beside = ~covered & (cv2.dilate(covered.astype(np.uint8), np.ones((reach, reach))) > 0)
    result = np.where(covered, near, inverse)
    still = ~moving
    if still.any():
        behind = of(still)
        mistaken = beside & (np.abs(inverse - near) < np.abs(inverse - behind))
        result[mistaken] = behind[mistaken]
    return result
