"""What a frame shows around a place at about the same depth, and how far other frames see it, too."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, Mask


@dataclass(frozen=True)
class GridOptions:
    """Resolution of the bilateral grid, and what is unlike its surroundings."""

    cells: int = 80
    """Cells along the picture's longer side. By eye."""
    depths: int = 32
    """Steps of inverse depth. By eye."""
    window: int = 7
    """Cells across what is around a place. By eye."""
    unlike: float = 0.1
    """Difference of colours (square root of linear light) from all that is around. By eye; with this test
    walk closes 76 instead of 68 % of the gap to the oracle at edges (32 px, true depth)."""


@dataclass(frozen=True)
class BilateralGrid:
    """A bilateral grid: of inverse depths, rows and columns (B, R, C).

    Chen, Paris and Durand, "Real-time edge-aware image processing with the bilateral grid", 2007.
    """

    share: Floats
    """(B, R, C) how often other frames see the same; 1 where there is nothing to be seen."""
    low: LinearRGB
    """(B, R, C, 3) least square roots of the colours around, infinite where there are none."""
    high: LinearRGB
    """(B, R, C, 3) largest square roots of the colours around, minus infinity where there are none."""
    size: Floats
    """(2,) width and height in pixels."""
    cell: float
    """Pixels across a cell."""
    first: float
    """Inverse depth of the first step."""
    step: float
    """Inverse depth from a step to the next."""
    unlike: float
    """`GridOptions.unlike`."""

    @classmethod
    def of(
        cls,
        places: Floats,
        inverse: Floats,
        colour: LinearRGB,
        seen: Floats,
        alike: Floats,
        options: GridOptions,
    ) -> BilateralGrid:
        """Of linear colours (n, 3) at places (n, 2) and inverse depths (n,), n > 0, that other frames saw so
        many times (n,), and alike so many times (n,)."""
        first, last = float(inverse.min()), float(inverse.max())
        size = places.max(axis=0)
        cell = max(size) / options.cells
        step = max((last - first) / (options.depths - 1), 1e-12)
        shape = (options.depths, *(size[::-1] / cell).astype(int) + 1)
        at = np.ravel_multi_index(_cells(places, inverse, (first, step, cell), shape), shape)
        total, same = (
            _summed(np.bincount(at, values, np.prod(shape)).reshape(shape), options.window)
            for values in (seen, alike)
        )
        share = np.where(total > 1e-6, same / np.maximum(total, 1e-6), 1)
        root = np.sqrt(np.maximum(colour, 0))
        low, high = (sign * _least(at, sign * root, shape, options.window) for sign in (1, -1))
        return cls(share, low, high, size, cell, first, step, options.unlike)

    def alike(self, places: Floats, inverse: Floats) -> Floats:
        """(n,) how often other frames see the same around places (n, 2) at inverse depths (n,), in [0, 1]."""
        return np.asarray(self.share[self._at(places, inverse)])

    def shows(self, places: Floats, inverse: Floats, colour: LinearRGB) -> Mask:
        """(n,) whether linear colours (n, 3) are among those around places (n, 2) at inverse depths (n,), or
        brighter, as lamps are; also where there are none or the frame ends."""
        at = self._at(places, inverse)
        root = np.sqrt(np.maximum(colour, 0))
        inside = np.all((places >= 0) & (places <= self.size), axis=1) & np.isfinite(self.low[at][:, 0])
        below = np.all(root <= self.high[at] + self.unlike, axis=1)
        among = below & np.all(root >= self.low[at] - self.unlike, axis=1)
        brighter = np.all(root >= self.high[at] - self.unlike, axis=1)
        return np.asarray(among | brighter | ~inside)

    def _at(self, places: Floats, inverse: Floats) -> tuple[Indices, ...]:
        """Three indices (n,) of the cells of places (n, 2) at inverse depths (n,)."""
        return _cells(places, inverse, (self.first, self.step, self.cell), self.share.shape)


def differ(a: LinearRGB, b: LinearRGB) -> Floats:
    """(...) by how much colours (..., 3) differ to the eye: the square roots of linear light."""
    return np.asarray(np.abs(np.sqrt(np.maximum(a, 0)) - np.sqrt(np.maximum(b, 0))).max(axis=-1))


def _cells(
    places: Floats, inverse: Floats, grid: tuple[float, float, float], shape: tuple[int, ...]
) -> tuple[Indices, ...]:
    """Three indices (n,) of the cells of places (n, 2) at inverse depths (n,), by the first inverse depth,
    its step and the pixels of a cell; those outside are in the nearest cell."""
    first, step, cell = grid
    index = np.column_stack([(inverse - first) / step + 0.5, places[:, ::-1] / cell])
    return tuple(np.clip(index, 0, np.array(shape) - 1).astype(np.intp).T)


def _summed(values: Floats, window: int) -> Floats:
    """(B, R, C) means over windows of rows and columns, summed with the depths beside."""
    # To OpenCV, which filters rows and columns, depths are channels.
    total = cv2.blur(np.moveaxis(values, 0, 2), (window, window), borderType=cv2.BORDER_CONSTANT)
    deep = np.pad(np.moveaxis(total, 2, 0), ((1, 1), (0, 0), (0, 0)))
    return np.asarray(deep[:-2] + 2 * deep[1:-1] + deep[2:])


def _least(at: Indices, values: LinearRGB, shape: tuple[int, ...], window: int) -> LinearRGB:
    """(B, R, C, 3) the least values (n, 3) in the cells (n,) and those beside, infinite where none are."""
    found = np.full((np.prod(shape), 3), np.inf, np.float32)
    np.minimum.at(found, at, values)
    flat = np.moveaxis(found.reshape(*shape, 3), 0, 2).reshape(*shape[1:], -1)
    flat = cv2.erode(flat, np.ones((window, window), np.uint8), borderType=cv2.BORDER_REPLICATE)
    deep = np.moveaxis(flat.reshape(*shape[1:], shape[0], 3), 2, 0)
    deep = np.pad(deep, ((1, 1), (0, 0), (0, 0), (0, 0)), constant_values=np.inf)
    return np.asarray(np.minimum.reduce([deep[:-2], deep[1:-1], deep[2:]]), np.float32)
