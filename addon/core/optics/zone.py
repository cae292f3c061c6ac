"""The in-focus zone: a range of distances around the focal plane that stays sharp.

A real lens has no such zone: the disc of a point grows with its contrast of inverse depth to the focal plane.
The zone takes a range of contrasts to nearly 0 and scales the rest, in front and behind by different
strengths. The map is monotone, so that occlusion stays right, and it can be inverted.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FLAT = 1e-4
"""Slope within the zone: discs there are less than a hundredth of a pixel, yet float64 inverts it."""


@dataclass(frozen=True)
class InFocusZone:
    """Ends of the zone as shares of the distance of the focal plane, and strengths of the blur outside.

    >>> zone = InFocusZone(front=0.5, behind=1.0)
    >>> zone.compressed(1 / np.array([1.0, 2.0, 3.0, 4.0, 8.0]) - 1 / 2, axis=1 / 2).round(3).tolist()
    [0.0, 0.0, -0.0, -0.0, -0.125]
    """

    front: float = 0.0
    """In front of the focal plane; 0.2 is up to a fifth of the distance nearer."""
    behind: float = 0.0
    """Behind the focal plane; 0.5 is up to half of the distance farther away."""
    front_strength: float = 1.0
    """Factor on discs in front of the zone."""
    behind_strength: float = 1.0
    """Factor on discs behind the zone."""

    @property
    def is_active(self) -> bool:
        """Return whether the zone changes any disc."""
        return self != InFocusZone()

    def compressed[T: np.floating](self, contrast: NDArray[T], axis: float) -> NDArray[T]:
        """Map contrasts of inverse depth (any shape) to those of the zone's blur, nearly 0 within the zone.

        `axis` is the inverse depth of the focal plane on the optical axis. Both are in 1 / scene units.
        """
        near, far = self._ends(axis)
        within = np.clip(contrast, -far, near)
        outside = contrast - within
        return np.asarray(FLAT * within + np.where(outside > 0, *self._slopes) * outside, contrast.dtype)

    def expanded[T: np.floating](self, contrast: NDArray[T], axis: float) -> NDArray[T]:
        """Invert `compressed`."""
        near, far = self._ends(axis)
        within = np.clip(contrast, -FLAT * far, FLAT * near)
        outside = contrast - within
        return np.asarray(within / FLAT + outside / np.where(outside > 0, *self._slopes), contrast.dtype)

    @property
    def _slopes(self) -> tuple[float, float]:
        """In front and behind; never 0, for the inverse."""
        return max(self.front_strength, FLAT), max(self.behind_strength, FLAT)

    def _ends(self, axis: float) -> tuple[float, float]:
        """Contrasts of the ends in front and behind, both positive."""
        return axis * self.front / (1 - self.front), axis * self.behind / (1 + self.behind)


NO_ZONE = InFocusZone()
