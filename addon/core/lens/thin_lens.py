"""The thin lens that a frame is seen through: circles of confusion, and what counts as in focus."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Map
from ..base.errors import UserError
from ..camera.reconstruction import Floats, Intrinsics

ACCEPTABLE = 1500
"""Picture diagonals per acceptable circle of confusion: the photographer's rule for depth of field."""
MAX_BLUR = 16.0
"""Picture diagonals; in a larger disc nothing is left of what it comes from. By eye."""
MAX_RADIUS = 100.0
"""Focus distances; with a larger aperture radius the focal plane as good as lies in the lens. By eye."""
PAST_BORDER = 2.0
"""Pixels that a mesh reaches past what any view sees, so that no view's resampling meets its end."""


@dataclass(frozen=True)
class ThinLens:
    """A thin lens before the pinhole camera of a frame, focused on a plane parallel to the picture.

    A point at depth Z is spread over a disc of diameter 2 R f |1/Z - 1/Zf| pixels: R is the aperture radius
    in scene units, f the focal length in pixels and Zf the distance of the focal plane in scene units.
    """

    pinhole: Intrinsics
    """The frame's camera without distortion, of the size that is rendered."""
    radius: float
    """Radius of the aperture in scene units."""
    focus: float
    """Inverse depth of the focal plane, 1 / scene units."""

    def disparity(self, inverse_depth: Floats) -> Floats:
        """Pixels by which points of inverse depth 1 / Z move in a view at the aperture's rim: R f / Z."""
        return np.asarray(self.radius * self.pinhole.fx * inverse_depth)

    def blur_disc(self, inverse_depth: Floats) -> Floats:
        """Signed diameters in pixels of the blur discs of inverse depths (any shape), positive before the
        focal plane and negative beyond it."""
        return np.asarray(2 * self.radius * self.pinhole.fx * (inverse_depth - self.focus))

    def largest_disc(self, inverse_depth: Floats, percentile: float = 99.0) -> float:
        """Diameter in pixels that `percentile` % of the blur discs of inverse depths are below; 0 of none."""
        if not inverse_depth.size:
            return 0.0
        contrast = float(np.percentile(np.abs(inverse_depth - self.focus), percentile))
        return 2 * float(self.radius) * self.pinhole.fx * contrast

    def margin(self, inverse_depth: Floats) -> float:
        """Pixels past the border that some view sees of a mesh with inverse depths of any shape."""
        contrast = np.abs(inverse_depth - self.focus).max(initial=0.0)
        return float(self.radius * self.pinhole.focal.max() * contrast + PAST_BORDER)

    def snap_to_focal_plane(self, inverse_depth: Floats) -> Floats:
        """Inverse depths (any shape), put into the focal plane where their blur disc is too small to be seen.

        The acceptable circle of confusion is the picture's diagonal / `ACCEPTABLE`. Depths are not known
        better than that, and resampling by fractions of a pixel would cost the subject its sharpness; in the
        focal plane every view shows the source's own pixels. Discs of twice that size and more stay as they
        are, those between grow linearly. Points with a disc beyond `MAX_BLUR` diagonals come back to it.
        """
        # A radius of almost nothing puts everything in focus: infinity does the same.
        with np.errstate(over="ignore", divide="ignore"):
            a_pixel = 1.0 / np.float64(2 * self.radius * self.pinhole.fx)
            smallest, largest = a_pixel * self._diagonal * np.array([1 / ACCEPTABLE, MAX_BLUR])
        return np.asarray(self.focus + _snapped(inverse_depth - self.focus, smallest, largest))

    def snap_displacement(self, displacement: Map) -> Map:
        """Displacements in pixels (any shape) at the aperture's rim, relative to the focal plane: what
        `snap_to_focal_plane` does, of the blur disc's radius."""
        smallest, largest = (np.float32(self._diagonal * share / 2) for share in (1 / ACCEPTABLE, MAX_BLUR))
        return np.asarray(_snapped(displacement, smallest, largest))

    def footprint(self, displacement: Map, views: int) -> Map:
        """Radii in pixels of the discs over which points are spread by the share of the aperture that one of
        so many views stands for: the blur disc's by the root of their number. Displacements in pixels (any
        shape) at the aperture's rim, relative to the focal plane."""
        return np.asarray(
            np.abs(self.snap_displacement(displacement)) / np.float32(np.sqrt(views)), np.float32
        )

    def check(self, frame: int, inverse_depth: Floats) -> None:
        """UserError naming the frame where the focal plane lies in the lens, or half of the points of inverse
        depth (n,) have discs beyond use."""
        if not float(self.radius) * self.focus <= MAX_RADIUS:
            raise UserError(
                f"frame {frame}: the focal plane at distance {1 / self.focus:g} lies in the lens,"
                f" whose radius is {self.radius:g}; focus farther away or choose a smaller aperture"
            )
        usual = self.largest_disc(inverse_depth, 50.0)
        if not usual <= MAX_BLUR * self._diagonal:
            raise UserError(
                f"frame {frame}: half of the picture has blur discs more than"
                f" {usual / self.pinhole.width:.3g} pictures wide; choose a smaller aperture or a focus"
                " farther away"
            )

    @property
    def _diagonal(self) -> float:
        """Of the picture, in pixels."""
        return float(np.hypot(self.pinhole.width, self.pinhole.height))


def _snapped[T: np.floating](contrast: NDArray[T], smallest: T, largest: T) -> NDArray[T]:
    """Contrasts (any shape), 0 up to the smallest size, growing to themselves at twice that, cut at the
    largest."""
    size = np.abs(contrast)
    kept = np.minimum(np.maximum(2 * (size - smallest), 0), np.minimum(size, largest))
    return np.asarray(np.copysign(kept, contrast))
