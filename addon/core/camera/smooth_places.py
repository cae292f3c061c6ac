"""Places that a smooth map gives to all pixels of a picture, from those that it gives to few."""

from collections.abc import Callable
from functools import lru_cache

import cv2
import numpy as np

from ..base.arrays import Floats

NODES = 48
"""Chebyshev nodes along each side. At 640x360 and 854x480, 17 lens models are within 3e-11 pixels of the
lens, and within 8e-10 with a rolling shutter, whose repetition ends near there."""
TESTED = 7
"""Places along each side at which the polynomial is compared with the map."""
LARGEST_ERROR = 1e-7
"""Pixels, beyond which the map itself is evaluated: a 600th of the last digit of a float32 of 1,000."""
KEPT_SIDES = 32
"""Lengths of sides whose weights are remembered, 0.4 MB each."""
Place = Callable[[Floats], Floats]
"""Pixels (..., 2) of one picture -> pixels (..., 2) of another."""


class SmoothPlaces:
    """The places of a picture's pixel centres under a map, such as a lens's distortion.

    A polynomial through the places of a few Chebyshev nodes (Trefethen, "Approximation theory and
    approximation practice", 2013) takes a fiftieth of the time that a rolling shutter takes for each pixel.
    Where it misses the map, as past a fold, the map is evaluated at each pixel.
    """

    def __init__(self, width: int, height: int, place: Place) -> None:
        """Fit `place` on a picture of a size in pixels."""
        self._width, self._place = width, place
        self._across, self._down = _weights(width), _weights(height)
        x, y = _nodes(width), _nodes(height)
        nodes = place(np.stack(np.meshgrid(x, y), axis=-1))
        self._nodes = nodes if np.isfinite(nodes).all() and self._fits(nodes, height) else None

    def _fits(self, nodes: Floats, height: int) -> bool:
        columns, rows = (np.linspace(0, n - 1, TESTED).astype(int) for n in (self._width, height))
        true = self._place(np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1))
        found = _interpolated(nodes, self._across[columns], self._down[rows])
        return bool(np.all(np.abs(found - true) <= LARGEST_ERROR))

    def rows(self, first: int, last: int) -> Floats:
        """Return the places (last - first, width, 2) of the pixels of some rows."""
        if self._nodes is not None:
            return _interpolated(self._nodes, self._across, self._down[first:last])
        return self._place(
            np.stack(np.meshgrid(np.arange(self._width) + 0.5, np.arange(first, last) + 0.5), axis=-1)
        )


def _interpolated(nodes: Floats, across: Floats, down: Floats) -> Floats:
    """(h, w, 2) of values at nodes (NODES, NODES, 2), by weights (w, NODES) and (h, NODES)."""
    # OpenBLAS's threads wait for each other here, for eight times the processor time.
    x, y = (
        cv2.gemm(cv2.gemm(down, one, 1, None, 0), across, 1, None, 0, flags=cv2.GEMM_2_T)
        for one in np.moveaxis(nodes, -1, 0).copy()
    )
    return np.asarray(cv2.merge([x, y]), np.float64)


def _nodes(count: int) -> Floats:
    """(NODES,) pixels of the nodes along a side of `count` pixels."""
    return (1 + np.cos(_ANGLES)) / 2 * count


@lru_cache(KEPT_SIDES)
def _weights(count: int) -> Floats:
    """(count, NODES) weights of the values at the nodes for the centres of `count` pixels."""
    angles = np.arccos(2 * (np.arange(count) + 0.5) / count - 1)
    scale = np.where(_DEGREES == 0, 1, 2) / NODES
    return np.cos(np.outer(angles, _DEGREES)) @ (scale[:, None] * np.cos(np.outer(_DEGREES, _ANGLES)))


_DEGREES = np.arange(NODES)
_ANGLES = (np.arange(NODES) + 0.5) * np.pi / NODES
