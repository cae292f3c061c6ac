"""Bilateral grid of a frame's colours, and of their agreement with other frames."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, Map, Mask
from .source_view import Places

CELLS = 80
"""Cells along the picture's longer side. Chosen by inspection."""
DEPTHS = 32
"""Steps of inverse depth. Chosen by inspection."""
WINDOW = 7
"""Width in cells of a position's surroundings. Chosen by inspection."""
UNLIKE = 0.1
"""Difference (square root of linear light) from all surrounding colours. Chosen by inspection; with this test
walk closes 76 instead of 68 % of the gap to the oracle at edges (32 px, true depth)."""


@dataclass(frozen=True)
class BilateralGrid:
    """A bilateral grid (B, R, C) of inverse depths, rows and columns.

    Chen, Paris and Durand, "Real-time edge-aware image processing with the bilateral grid", 2007.
    """

    share: Floats
    """(B, R, C) share of other frames that agree; 1 in empty cells."""
    low: Map
    """(3, B, R, C) least square roots of the surrounding colours, infinite if there are none."""
    high: Map
    """(3, B, R, C) largest square roots of the surrounding colours, minus infinity if there are none."""
    size: Floats
    """(2,) width and height in pixels."""
    cell: float
    """Pixels a cell."""
    first: float
    """Inverse depth of the first step."""
    step: float
    """Inverse depth between steps."""

    @classmethod
    def of(cls, places: Places, root: Map, seen: Map, alike: Map) -> BilateralGrid:
        """Make a grid of places, at least one, with square roots of linear colours (3, n).

        `seen` (n,) is the number of frames that see them, `alike` (n,) of those that see them alike.
        """
        first, last = float(places.inverse.min()), float(places.inverse.max())
        size = np.array([places.x.max(), places.y.max()], np.float64)
        cell = float(max(size)) / CELLS
        step = (last - first) / (DEPTHS - 1) or 1.0
        shape = (DEPTHS, *(size[::-1] / cell).astype(int) + 1)
        at = _cells(places, (first, step, cell), shape)
        total, same = (
            _summed(np.bincount(at, values, np.prod(shape)).reshape(shape)) for values in (seen, alike)
        )
        share = np.where(total > 1e-6, same / np.maximum(total, 1e-6), 1)
        low, high = (sign * _least(at, sign * root, shape) for sign in (1, -1))
        return cls(share, low, high, size, cell, first, step)

    def cells(self, places: Places) -> Indices:
        """Return the (n,) indices of the cells of positions."""
        return _cells(places, (self.first, self.step, self.cell), self.share.shape)

    def alike(self, cells: Indices) -> Floats:
        """Return the (n,) share of other frames, in [0, 1], that agree around cells (n,)."""
        return np.asarray(self.share.ravel()[cells])

    def shows(self, places: Places, cells: Indices, root: Map) -> Mask:
        """Return whether roots of colours (3, n) are among those around their places and cells, or brighter.

        Highlights are brighter. It is true in empty cells, and past the frame.
        """
        low, high = (bound.reshape(3, -1)[:, cells] for bound in (self.low, self.high))
        inside = (places.x >= 0) & (places.x <= self.size[0]) & (places.y >= 0) & (places.y <= self.size[1])
        inside &= np.isfinite(low[0])
        among = np.all((root <= high + UNLIKE) & (root >= low - UNLIKE), axis=0)
        brighter = np.all(root >= high - UNLIKE, axis=0)
        return np.asarray(among | brighter | ~inside)


def _cells(places: Places, grid: tuple[float, float, float], shape: tuple[int, ...]) -> Indices:
    """Return (n,) cells in the raveled grid (first inverse depth, step, pixels a cell), clipped to it."""
    first, step, cell = grid
    index = ((places.inverse - first) / step + 0.5, places.y / cell, places.x / cell)
    depth, row, column = (
        np.clip(value, 0, count - 1).astype(np.intp) for value, count in zip(index, shape, strict=True)
    )
    return np.asarray((depth * shape[1] + row) * shape[2] + column)


def _summed(values: Floats) -> Floats:
    """Average values (B, R, C) over windows of rows and columns, and sum neighbouring depths."""
    # OpenCV filters rows and columns; depths are its channels.
    total = cv2.blur(np.moveaxis(values, 0, 2), (WINDOW, WINDOW), borderType=cv2.BORDER_CONSTANT)
    deep = np.pad(np.moveaxis(total, 2, 0), ((1, 1), (0, 0), (0, 0)))
    return np.asarray(deep[:-2] + 2 * deep[1:-1] + deep[2:])


def _least(at: Indices, values: Map, shape: tuple[int, ...]) -> Map:
    """Return (3, B, R, C) minima of values (3, n) over cells (n,) and their neighbours, or infinity."""
    found = np.full((3, np.prod(shape)), np.inf, np.float32)
    for channel, value in zip(found, values, strict=True):
        np.minimum.at(channel, at, value)
    flat = np.moveaxis(found.reshape(-1, *shape[1:]), 0, 2)
    flat = cv2.erode(flat, np.ones((WINDOW, WINDOW), np.uint8), borderType=cv2.BORDER_REPLICATE)
    deep = np.moveaxis(flat, 2, 0).reshape(3, *shape)
    deep = np.pad(deep, ((0, 0), (1, 1), (0, 0), (0, 0)), constant_values=np.inf)
    return np.asarray(np.minimum.reduce([deep[:, :-2], deep[:, 1:-1], deep[:, 2:]]), np.float32)
