"""The oracle: the same one frame, but with the surfaces that it hides.

Each layer of the scene is handed over without the ones before it, as the same camera would have recorded it:
8 bits, clipped. For every view each layer is resampled by its own depth, and the layers are laid over each
other from far to near. What an oracle misses is the cost of sampling, 8 bits and clipping, never a hidden
surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.optics.aperture_sampling import vogel_disc

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]

STEPS = 4
"""Fixed-point steps of the inverse warp; each shrinks the error by (disc gradient), far below one."""


@dataclass(frozen=True)
class Layer:
    """One layer on a canvas that reaches past the frame's border by the margin, in pixels."""

    picture: Picture
    """(h, w, 4) linear, premultiplied."""
    inverse_depth: NDArray[np.float32]
    """(h, w) 1 / z, defined everywhere: around the layer, the nearest of its own."""


@dataclass(frozen=True)
class LayeredDepthImage:
    layers: tuple[Layer, ...]
    """From far to near."""
    margin: int
    air: tuple[float, float, float]
    """Radiance behind all layers."""


def extended(depth: Floats) -> NDArray[np.float32]:
    """Inverse depth (h, w) of a layer's depth (h, w), inf outside it, carried on to everywhere."""
    known = np.isfinite(depth)
    if not known.any():
        return np.zeros(depth.shape, np.float32)
    unknown = np.where(known, 0, 1).astype(np.uint8)
    _, label = cv2.distanceTransformWithLabels(unknown, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    value = np.zeros(label.max() + 1, np.float32)
    value[label[known]] = 1 / depth[known]
    return np.asarray(value[label], dtype=np.float32)


def render(layers: LayeredDepthImage, focal: float, radius: float, focus: float, views: int) -> Picture:
    """(H, W, 3) linear: the mean of views over a lens of `radius` focused at depth `focus`.

    `focal` is in pixels, the others in scene units.
    """
    offsets = (focal * radius * vogel_disc(views)).astype(np.float32)
    height, width = layers.layers[0].inverse_depth.shape
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    total = np.zeros((height, width, 3), np.float32)
    for offset in offsets:
        view = np.empty((height, width, 3), np.float32)
        view[:] = layers.air
        for layer in layers.layers:
            seen = _warp(layer, grid, offset, np.float32(1 / focus))
            view = seen[..., :3] + (1 - seen[..., 3:]) * view
        total += view
    m = layers.margin
    return total[m : height - m, m : width - m] / np.float32(views)


def _warp(layer: Layer, grid: Picture, offset: NDArray[np.float32], focus: np.float32) -> Picture:
    """The layer as a virtual camera sees it, the focal plane in register: x' = x - f o (1/z(x) - 1/zf)."""
    place = grid
    for _ in range(STEPS):
        inverse = cv2.remap(
            layer.inverse_depth, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        place = grid + offset * (inverse - focus)[..., None]
    return np.asarray(
        cv2.remap(layer.picture, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE),
        dtype=np.float32,
    )
