"""What a frame shows around a place at about the same depth, and how far other frames see it, too."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..camera.canvas import Picture
from ..camera.reconstruction import Floats

Mask = NDArray[np.bool_]

CELLS, DEPTHS, BESIDE = 80, 32, 7
"""What is around: so many cells in a row, so many depths, and so many cells to a side."""
UNLIKE = 0.1
"""Difference of colours (square root of linear light) beyond all that is around."""


@dataclass(frozen=True)
class BilateralGrid:
    """A bilateral grid: of depths, rows and columns (B, R, C).

    Chen, Paris and Durand, "Real-time edge-aware image processing with the bilateral grid", 2007.
    """

    share: Floats
    """How often other frames see the same; 1 where there is nothing to be seen."""
    low: Picture
    """(B, R, C, 3) least and largest square roots of the colours, infinite where there is nothing."""
    high: Picture
    size: Floats
    """(2,) width and height in pixels,"""
    cell: float
    """and of a cell."""
    first: float
    """Inverse depth of the first, and their distance."""
    step: float

    @classmethod
    def of(
        cls, places: Floats, inverse: Floats, colour: Picture, seen: Floats, alike: Floats
    ) -> BilateralGrid:
        """Of linear colours (n, 3) at places (n, 2) and inverse depths (n,), n > 0, that were seen so many
        times (n,), and looked alike."""
        first, last = float(inverse.min()), float(inverse.max())
        size = places.max(axis=0)
        cell = max(size) / CELLS
        step = max((last - first) / (DEPTHS - 1), 1e-12)
        shape = (DEPTHS, *(size[::-1] / cell).astype(int) + 1)
        at = np.ravel_multi_index(_cells(places, inverse, (first, step, cell), shape), shape)
        total, same = (
            _summed(np.bincount(at, values, np.prod(shape)).reshape(shape)) for values in (seen, alike)
        )
        share = np.where(total > 1e-6, same / np.maximum(total, 1e-6), 1)
        root = np.sqrt(np.maximum(colour, 0))
        low, high = _least(at, root, shape), -_least(at, -root, shape)
        return cls(share, low, high, size, cell, first, step)

    def alike(self, places: Floats, inverse: Floats) -> Floats:
        """(n,) the share at places (n, 2) at inverse depths (n,)."""
        return np.asarray(self.share[self._at(places, inverse)])

    def shows(self, places: Floats, inverse: Floats, colour: Picture) -> Mask:
        """(n,) whether linear colours (n, 3) are among those around places (n, 2) at inverse depths (n,), or
        brighter, as lamps are; also where there are none or the frame ends."""
        at = self._at(places, inverse)
        root = np.sqrt(np.maximum(colour, 0))
        inside = np.all((places >= 0) & (places <= self.size), axis=1) & np.isfinite(self.low[at][:, 0])
        below = np.all(root <= self.high[at] + UNLIKE, axis=1)
        among = below & np.all(root >= self.low[at] - UNLIKE, axis=1)
        brighter = np.all(root >= self.high[at] - UNLIKE, axis=1)
        return np.asarray(among | brighter | ~inside)

    def _at(self, places: Floats, inverse: Floats) -> tuple[NDArray[np.intp], ...]:
        return _cells(places, inverse, (self.first, self.step, self.cell), self.share.shape)


def differ(a: Picture, b: Picture) -> Floats:
    """(...) by how much colours (..., 3) differ to the eye: the square roots of linear light."""
    return np.asarray(np.abs(np.sqrt(np.maximum(a, 0)) - np.sqrt(np.maximum(b, 0))).max(axis=-1))


def _cells(
    places: Floats, inverse: Floats, grid: tuple[float, float, float], shape: tuple[int, ...]
) -> tuple[NDArray[np.intp], ...]:
    first, step, cell = grid
    index = np.column_stack([(inverse - first) / step + 0.5, places[:, ::-1] / cell])
    return tuple(np.clip(index, 0, np.array(shape) - 1).astype(np.intp).T)


def _summed(values: Floats) -> Floats:
    """(B, R, C) with the cells beside."""
    # To OpenCV, which filters rows and columns, depths are channels.
    total = cv2.blur(np.moveaxis(values, 0, 2), (BESIDE, BESIDE), borderType=cv2.BORDER_CONSTANT)
    deep = np.pad(np.moveaxis(total, 2, 0), ((1, 1), (0, 0), (0, 0)))
    return np.asarray(deep[:-2] + 2 * deep[1:-1] + deep[2:])


def _least(at: NDArray[np.intp], values: Picture, shape: tuple[int, ...]) -> Picture:
    """(B, R, C, 3) the least values (n, 3) in the cells (n,) and those beside, infinite where none are."""
    found = np.full((np.prod(shape), 3), np.inf, np.float32)
    np.minimum.at(found, at, values)
    flat = np.moveaxis(found.reshape(*shape, 3), 0, 2).reshape(*shape[1:], -1)
    flat = cv2.erode(flat, np.ones((BESIDE, BESIDE), np.uint8), borderType=cv2.BORDER_REPLICATE)
    deep = np.moveaxis(flat.reshape(*shape[1:], shape[0], 3), 2, 0)
    deep = np.pad(deep, ((1, 1), (0, 0), (0, 0), (0, 0)), constant_values=np.inf)
    return np.asarray(np.minimum.reduce([deep[:-2], deep[1:-1], deep[2:]]), np.float32)
