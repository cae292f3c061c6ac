"""Depth of one frame where another one sees it."""

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import Map
from ..camera.reconstruction import Image, Intrinsics
from .map_fusion import BORDER
from .multi_view_stereo import DenseDepth, pixel_matrix
from .view_selection import relative_pose


def in_place(
    depth: DenseDepth, image: Image, camera: Intrinsics, here: Image, margin: int
) -> tuple[Map, Map, Map]:
    """Reproject a frame's depth into the pinhole `camera` of another one, with `margin` m pixels around it.

    The nearest of several values in a pixel counts.

    Returns:
        (h + 2 m, w + 2 m) inverse depth; its weight, the confidence, 0 in unseen pixels; and the largest
            inverse depth at which the frame would see something there.
    """
    if image.frame == here.frame:
        inverse, weight = (np.pad(part, margin) for part in (depth.inverse_depth, _weight(depth)))
        return inverse, weight, np.full_like(inverse, np.inf)
    wide = replace(
        camera, width=camera.width + 2 * margin, height=camera.height + 2 * margin,
        cx=camera.cx + margin, cy=camera.cy + margin,
    )  # fmt: skip
    return *_reprojected(depth, image, wide, here), _nearest_seen(depth, image, wide, here)


def _nearest_seen(depth: DenseDepth, image: Image, camera: Intrinsics, here: Image) -> Map:
    """(h, w) largest inverse depth of a frame's rays inside another frame's picture, less `BORDER`."""
    rotation, translation = relative_pose(here, image)
    there = pixel_matrix(depth.pinhole)
    far, step = there @ rotation @ np.linalg.inv(pixel_matrix(camera)), there @ translation
    height, width = depth.inverse_depth.shape
    sides = np.array([
        [1, 0, -BORDER], [-1, 0, width - 1 - BORDER], [0, 1, -BORDER], [0, -1, height - 1 - BORDER],
        [0, 0, 1],
    ])  # fmt: skip
    x, y = np.arange(camera.width, dtype=np.float32), np.arange(camera.height, dtype=np.float32)[:, None]
    nearest = np.full((camera.height, camera.width), np.inf, np.float32)
    for at, slope in zip(sides @ far, sides @ step, strict=True):
        if slope < 0:
            per_x, per_y, per_1 = (-at / slope).astype(np.float32)
            np.minimum(nearest, per_x * x + (per_y * y + per_1), out=nearest)
    return nearest


def _weight(depth: DenseDepth) -> Map:
    """(h, w) confidence, a little everywhere, and no more in `BORDER` pixels at the picture's border."""
    weight = np.maximum(depth.confidence, np.float32(1e-3))
    inner = np.zeros(weight.shape, bool)
    inner[BORDER:-BORDER, BORDER:-BORDER] = True
    return np.where(inner, weight, np.float32(1e-3))


def _reprojected(depth: DenseDepth, image: Image, camera: Intrinsics, here: Image) -> tuple[Map, Map]:
    """(h, w) nearest inverse depth of another frame in a frame's pixels, and its confidence, 0 if empty."""
    rotation, translation = relative_pose(image, here)
    back = np.linalg.inv(pixel_matrix(depth.pinhole))
    matrix, parallax = pixel_matrix(camera) @ rotation @ back, pixel_matrix(camera) @ translation
    height, width = depth.inverse_depth.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    places = [
        np.float32(r[0]) * x + np.float32(r[1]) * y + np.float32(r[2]) + np.float32(p) * depth.inverse_depth
        for r, p in zip(matrix, parallax, strict=True)
    ]
    ahead = np.maximum(places[2], np.float32(0.05))
    column, row = (np.rint(part / ahead).clip(-1, 1 << 20).astype(np.int32) for part in places[:2])
    shape = (camera.height, camera.width)
    inside = (places[2] > 0.05) & (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])
    inside &= ~depth.moving
    value, weight = (depth.inverse_depth / ahead)[inside], _weight(depth)[inside]
    at = (row * shape[1] + column)[inside]
    inverse, confidence = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    np.maximum.at(inverse.ravel(), at, value)
    nearest = value == inverse.ravel()[at]
    confidence.ravel()[at[nearest]] = weight[nearest]
    # Pixels between two that a surface was drawn apart by are its own, too.
    for size in ((1, 2), (2, 1)):
        kernel, last = np.ones(size, np.uint8), (size[1] - 1, size[0] - 1)
        closed, around = (
            cv2.erode(cv2.dilate(part, kernel, anchor=last), kernel, anchor=(0, 0))
            for part in (inverse, confidence)
        )
        crack = closed > inverse * np.float32(1.02)
        inverse, confidence = np.where(crack, closed, inverse), np.where(crack, around, confidence)
    return inverse, confidence
