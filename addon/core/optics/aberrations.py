"""Aberrations: how far a ray lands from where a perfect lens sends it.

A ray is known by its place p on the aperture, in aperture radii, and its place h in the picture, in halves of
the picture's diagonal from the middle, both x right and y down. Shifts are in shares of the radius to which
infinitely far points are blurred. They are Seidel's terms of third order (Welford, "Aberrations of optical
systems", 1986); field curvature, which only changes the depth in focus, is one of `ThinLens`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, Map
from .aperture import Aperture

COMA_LENGTH = 3.0
"""Ratio of a comet's length to the coefficient: its largest circle is centred at 2, with radius 1."""


@dataclass(frozen=True)
class Aberrations:
    """Shifts of rays over the aperture and the picture.

    >>> Aberrations(swirl=0.5).shift(np.array([0.0, 1.0]), np.array([1.0, 0.0])).tolist()
    [0.0, 0.5]
    """

    swirl: float = 0.0
    anamorphic_focus: float = 0.0
    coma: float = 0.0
    """See `Aperture`."""

    @classmethod
    def of(cls, aperture: Aperture) -> Aberrations:
        """Return those of a lens."""
        return cls(aperture.swirl, aperture.anamorphic_focus, aperture.coma)

    @property
    def is_active(self) -> bool:
        """Return whether any ray is shifted."""
        return self != NO_ABERRATIONS

    @property
    def largest(self) -> float:
        """An upper bound of all shifts within the picture."""
        return abs(self.swirl) + abs(self.anamorphic_focus) + abs(self.coma)

    def shift(self, p: Floats, h: Floats) -> Floats:
        """Return shifts (..., 2) of rays through places p (..., 2) at places h (..., 2)."""
        along, far = np.sum(p * h, axis=-1, keepdims=True), np.sum(h * h, axis=-1, keepdims=True)
        squared = np.sum(p * p, axis=-1, keepdims=True)
        found = self.swirl * (far * p - along * h)
        found = found + self.coma / COMA_LENGTH * (2 * along * p + squared * h)
        return np.asarray(found + self.anamorphic_focus * p * [1.0, 0.0])

    def matrix(self, h: Floats) -> Floats:
        """Return the part (2, 2) of `shift` that is linear in p, at a place (2,)."""
        around = self.swirl * (h @ h * np.eye(2) - np.outer(h, h))
        return np.asarray(around + np.diag([self.anamorphic_focus, 0.0]))

    def radius(self, displacement: Map, h: Floats, reach: float) -> Map:
        """Return signed radii (h, w) in pixels of discs as large as those of displacements (h, w).

        A ray from a place p lands at -displacement p + reach shift(p, h), for places h (h, w, 2) and `reach`
        pixels, the blur radius of infinitely far points. The disc has the mean squared derivative by p.
        """
        far, down = np.sum(h * h, axis=-1), h[..., 1] ** 2
        around, sideways = reach * self.swirl * far, reach * self.anamorphic_focus
        squared = displacement * (displacement - around - sideways)
        # Half of the squared matrix; the first element of h^2 I - h h^T is y^2.
        squared += (around**2 + sideways**2) / 2 + reach * self.swirl * down * sideways
        # E[px^2] = E[py^2] = 1/4 over a disc.
        squared += 6 * (reach * self.coma / COMA_LENGTH) ** 2 * far
        return np.asarray(np.copysign(np.sqrt(np.maximum(squared, 0)), displacement), np.float32)


NO_ABERRATIONS = Aberrations()


def scattered(places: Floats, light: Floats, size: int) -> Floats:
    """Return the light (size, size) of points, spread bilinearly over the nearest pixels.

    Args:
        places: (n, 2) in pixels from the middle; points outside are lost.
        light: (n,) of the points.
        size: Pixels along a side.
    """
    at = places + (size - 1) / 2
    first = np.floor(at).astype(int)
    share = at - first
    total = np.zeros(size * size)
    for down in (0, 1):
        for across in (0, 1):
            column, row = first[:, 0] + across, first[:, 1] + down
            part = light * np.abs(1 - across - share[:, 0]) * np.abs(1 - down - share[:, 1])
            inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
            total += np.bincount((row * size + column)[inside], part[inside], size * size)
    return total.reshape(size, size)
