"""The thin lens of a frame: circles of confusion, and the range in focus.

A tilted focal plane has inverse depth F(x, y), linear over the picture. The shear of space from 1 / Z to 1 /
Z - F(x, y) + const keeps pixels and occlusion, and makes the plane parallel to the picture. A view from (p,
q) on the aperture, with the tilted plane in register, is a view of the sheared scene from (p, q) / (1 - s),
where s is the share of the way to the intersection of the focal plane with the lens's plane (the Scheimpflug
line; `ThinLens.sheared_positions`). Renderers therefore know only planes parallel to the picture: they get
inverse depths `rectified`, in which the in-focus zone is flat, too (`zone.py`), and so is a curved field:
that shear is not linear, but bends no view by more than the curvature's share of a blur disc.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Map
from ..base.errors import UserError
from ..camera.reconstruction import Intrinsics
from .zone import NO_ZONE, InFocusZone

ACCEPTABLE = 1500
"""Picture diagonals per acceptable circle of confusion: the photographer's rule for depth of field."""
MAX_BLUR = 16.0
"""Picture diagonals; a larger disc dissolves its object."""
MAX_RADIUS = 100.0
"""Focus distances; with a larger radius the focal plane is nearly in the lens."""
NEAREST_LINE = 2.0
"""Aperture radii, at which a tilted focal plane may come to the middle of the lens; at 1 it would touch the
aperture, and blur discs there would have no end."""
LIFT = 2.0
"""Times the picture's half, up to which inverse depths without a plane's tilt are positive: meshes reach past
the border. Chosen by inspection."""
PAST_BORDER = 2.0
"""Pixels that a mesh reaches past what any view sees, so that no view's resampling meets its end."""


@dataclass(frozen=True)
class ThinLens:
    """A thin lens before the pinhole camera of a frame, focused on a plane.

    Inverse depths are those of `rectified`, which changes nothing for a plane parallel to the picture without
    an in-focus zone.

    A point at depth Z is spread over a disc of diameter 2 R f |1/Z - 1/Zf| pixels: R is the aperture radius
    in scene units, f the focal length in pixels and Zf the distance of the focal plane in scene units.

    >>> lens = ThinLens(Intrinsics(1920, 1080, 1600, 1600, 960, 540), radius=0.1, focus=1 / 5)
    >>> lens.blur_disc(1 / np.array([4.0, 5.0, 10.0, np.inf])).round(3).tolist()
    [16.0, 0.0, -32.0, -64.0]
    """

    pinhole: Intrinsics
    """The frame's camera without distortion, of the size that is rendered."""
    radius: float
    """Radius of the aperture in scene units."""
    focus: float
    """Inverse depth of the focal plane, 1 / scene units; of a tilted one, once it is `rectified`."""
    slope: tuple[float, float] = (0.0, 0.0)
    """By how much the inverse depth of the focal plane grows a pixel to the right, and down: its tilt."""
    lift: float = 0.0
    """Added to inverse depths `rectified`, so that they are positive."""
    zone: InFocusZone = NO_ZONE
    curvature: float = 0.0
    """Share of the inverse depth on the axis by which the corners focus nearer: field curvature. It grows
    with the square of the distance from the principal point."""

    @classmethod
    def on_plane(
        cls, pinhole: Intrinsics, radius: float, inverse: float, slope: tuple[float, float]
    ) -> ThinLens:
        """Return a lens focused on a plane, by its inverse depth on the axis and its slope a pixel."""
        if slope == (0.0, 0.0):
            return cls(pinhole, radius, inverse)
        centre, size = pinhole.principal_point, np.array([pinhole.width, pinhole.height])
        half = np.maximum(centre, size - centre)
        lift = LIFT * float(np.abs(slope) @ half)
        return cls(pinhole, radius, inverse + lift, slope, lift)

    @property
    def is_tilted(self) -> bool:
        """Return whether the focal plane is not parallel to the picture."""
        return self.slope != (0.0, 0.0)

    @property
    def is_plain(self) -> bool:
        """Return whether `rectified` changes nothing."""
        return self._is_flat and not self.zone.is_active

    @property
    def _is_flat(self) -> bool:
        """Return whether one inverse depth is in focus all over the picture."""
        return not (self.is_tilted or self.curvature)

    def curved(self, curvature: float) -> ThinLens:
        """Return the lens with a `curvature` of its field."""
        if not curvature:
            return self
        more = LIFT**2 * self.axis * max(curvature, 0.0)
        return replace(self, focus=self.focus + more, lift=self.lift + more, curvature=curvature)

    def rectified[T: np.floating](self, inverse_depth: NDArray[T], xy: Floats) -> NDArray[T] | Floats:
        """Return inverse depths (n,) at pixels (n, 2) with a frontal focal plane and a flat in-focus zone."""
        if self._is_flat:
            return self._zoned(inverse_depth)
        return self._zoned(inverse_depth - self._tilt(xy[..., 0], xy[..., 1]))

    def unrectified(self, inverse_depth: Floats, xy: Floats) -> Floats:
        """Return inverse depths (n,) at pixels (n, 2) of the scene: the inverse of `rectified`."""
        if self.zone.is_active:
            contrast = self.zone.expanded(np.asarray(inverse_depth) - self.focus, self.axis)
            inverse_depth = np.asarray(self.focus + contrast)
        return inverse_depth if self._is_flat else inverse_depth + self._tilt(xy[..., 0], xy[..., 1])

    def rectified_raster[T: np.floating](self, inverse_depth: NDArray[T]) -> NDArray[T] | Floats:
        """Return inverse depths (H + 2 m, W + 2 m) of a picture and m pixels around it, `rectified`."""
        if self._is_flat:
            return self._zoned(inverse_depth)
        return self.rectified(inverse_depth, self.raster_places(inverse_depth.shape))

    def raster_places(self, shape: tuple[int, ...]) -> Floats:
        """Return the pixels (h, w, 2) of a raster of a shape (h, w) with the picture in its middle."""
        rows, columns = shape
        top, left = (rows - self.pinhole.height) // 2, (columns - self.pinhole.width) // 2
        return np.dstack(np.meshgrid(np.arange(columns) + 0.5 - left, np.arange(rows) + 0.5 - top))

    @property
    def axis(self) -> float:
        """Inverse depth of the focal plane on the optical axis, in the scene."""
        return self.focus - self.lift

    def _zoned[T: np.floating](self, inverse_depth: NDArray[T]) -> NDArray[T] | Floats:
        """Flatten the in-focus zone, in float64: contrasts there are small."""
        if not self.zone.is_active:
            return inverse_depth
        contrast = np.asarray(inverse_depth, np.float64) - self.focus
        return np.asarray(self.focus + self.zone.compressed(contrast, self.axis))

    def _tilt(self, x: Floats, y: Floats) -> Floats:
        """Inverse depth in focus at pixels of any shape, less `focus`."""
        across, down = (at - centre for at, centre in zip((x, y), self.pinhole.principal_point, strict=True))
        plane = self.slope[0] * across + self.slope[1] * down - self.lift
        if not self.curvature:
            return np.asarray(plane)
        far = (across**2 + down**2) / (self._diagonal / 2) ** 2
        return np.asarray(plane + self.curvature * self.axis * far)

    def sheared_positions(self, positions: Floats) -> Floats:
        """Return positions (N, 2), in scene units, for views of the sheared scene.

        From there the sheared scene looks like the scene from positions (N, 2) on the aperture, with the
        focal plane in register.
        """
        return positions / (1 - positions @ self._hinge)[:, None] if self.is_tilted else positions

    def aperture_positions(self, positions: Floats) -> Floats:
        """Return (N, 2) positions on the aperture in scene units, from `sheared_positions` (N, 2)."""
        return positions / (1 + positions @ self._hinge)[:, None] if self.is_tilted else positions

    @property
    def _hinge(self) -> Floats:
        """(2,) inverse distance and direction from the lens's centre to the Scheimpflug line."""
        return np.asarray(self.slope * self.pinhole.focal)

    @property
    def stretch(self) -> float:
        """Times the aperture's radius, within which all `sheared_positions` are."""
        return 1 / (1 - self.radius * float(np.linalg.norm(self._hinge))) if self.is_tilted else 1.0

    @property
    def acceptable_disc(self) -> float:
        """Diameter in pixels of the acceptable circle of confusion: the picture's diagonal / `ACCEPTABLE`."""
        return self._diagonal / ACCEPTABLE

    @property
    def sharp_distances(self) -> tuple[float, float]:
        """The nearest and farthest sharp distance on the optical axis, in scene units.

        Their blur discs have the size `acceptable_disc`; the farthest can be infinite.
        """
        allowed = self.acceptable_disc / (2 * self.radius * self.pinhole.fx)
        edges = self.axis + self.zone.expanded(np.array([allowed, -allowed]), self.axis)
        near, far = (float(1 / edge) if edge > 0 else np.inf for edge in edges)
        return near, far

    @property
    def disparity_scale(self) -> float:
        """R f in scene units times pixels: disparity at the aperture's rim per unit of inverse depth."""
        return self.radius * self.pinhole.fx

    def disparity[T: np.floating](self, inverse_depth: NDArray[T]) -> NDArray[T] | Floats:
        """Return R f / Z in pixels (any shape), the motion of points in a view from the aperture's rim."""
        return np.asarray(self.disparity_scale * inverse_depth)

    def displacement(self, inverse_depth: Floats) -> Floats:
        """Return signed radii in pixels of the blur discs of inverse depths (any shape).

        They are the `disparity` relative to the focal plane, positive in front of it and negative behind it.
        """
        return np.asarray(self.disparity_scale * (inverse_depth - self.focus))

    def blur_disc(self, inverse_depth: Floats) -> Floats:
        """Return signed diameters of blur discs in pixels (any shape), positive in front of the focus."""
        return 2 * self.displacement(inverse_depth)

    def largest_disc(self, inverse_depth: Floats, percentile: float = 99.0) -> float:
        """Return the percentile of the diameters in pixels of blur discs (any shape); 0 without discs."""
        if not inverse_depth.size:
            return 0.0
        contrast = float(np.percentile(np.abs(inverse_depth - self.focus), percentile))
        return 2 * float(self.radius) * self.pinhole.fx * contrast

    def margin(self, inverse_depth: Floats) -> float:
        """Return the pixels past the border that views see of a mesh with inverse depths of any shape."""
        contrast = np.abs(inverse_depth - self.focus).max(initial=0.0)
        return float(self.stretch * self.radius * self.pinhole.focal.max() * contrast + PAST_BORDER)

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
        """Return displacements (any shape), in pixels at the aperture's rim, snapped to the focal plane.

        The blur disc's radius is snapped like `snap_to_focal_plane`.
        """
        smallest, largest = (np.float32(self._diagonal * share / 2) for share in (1 / ACCEPTABLE, MAX_BLUR))
        return np.asarray(_snapped(displacement, smallest, largest))

    def footprint(self, displacement: Map, views: int) -> Map:
        """Return the radii in pixels of discs over which each of a number of views spreads its points.

        One of N views stands for an N-th of the aperture: the blur disc's radius, that of `displacement` in
        pixels (any shape), divided by sqrt(N).
        """
        return np.asarray(
            np.abs(self.snap_displacement(displacement)) / np.float32(np.sqrt(views)), np.float32
        )

    def check(self, frame: int, inverse_depth: Floats) -> None:
        """Check that a frame with points of inverse depths (n,) can be drawn with this lens.

        Raises UserError if the focal plane lies in the lens, or half of the points have discs beyond
        `MAX_BLUR`.
        """
        if not float(self.radius) * self.focus <= MAX_RADIUS:
            raise UserError(
                f"frame {frame}: the focal plane at distance {1 / self.focus:g} is inside the lens, whose"
                f" radius is {self.radius:g}; focus farther away or use a smaller aperture"
            )
        if not NEAREST_LINE * self.radius * float(np.linalg.norm(self._hinge)) <= 1:
            raise UserError(
                f"frame {frame}: the focal plane is tilted so far that it comes within {NEAREST_LINE:g}"
                " radii of the aperture; tilt it less, focus farther away or use a smaller aperture"
            )
        disc = self.largest_disc(inverse_depth, 50.0)
        if not disc <= MAX_BLUR * self._diagonal:
            raise UserError(
                f"frame {frame}: half of the picture has blur discs more than"
                f" {disc / self.pinhole.width:.3g} pictures wide; use a smaller aperture or focus farther"
                " away"
            )

    @property
    def _diagonal(self) -> float:
        """Diagonal of the picture in pixels."""
        return float(np.hypot(self.pinhole.width, self.pinhole.height))


def _snapped[T: np.floating](contrast: NDArray[T], smallest: T, largest: T) -> NDArray[T]:
    """Contrasts (any shape): 0 up to `smallest`, unchanged from twice that, and cut at `largest`."""
    size = np.abs(contrast)
    kept = np.minimum(np.maximum(2 * (size - smallest), 0), np.minimum(size, largest))
    return np.asarray(np.copysign(kept, contrast))
