"""The virtual cameras of a frame, which the renderer follows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arrays import Floats, Map
from ..camera.canvas import Canvas
from ..optics.aberrations import NO_ABERRATIONS, Aberrations
from ..optics.aperture import ApertureSamples
from ..optics.aperture_sampling import exact_registration
from ..optics.thin_lens import ThinLens


@dataclass(frozen=True)
class Views:
    """Virtual cameras over the aperture of one camera, and how their light is summed."""

    canvas: Canvas
    """Canvas of the frame's camera, or of a steadier one."""
    lens: ThinLens
    """Lens of this camera."""
    offsets: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(N, 2) positions in scene units, x right and y down, as `ThinLens.sheared_positions`."""
    registration: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))
    """(N, 2, 3) maps from pixels of a view to pixels in register with the focal plane."""
    weights: Floats | None = None
    """(N,) shares of the aperture's light; None for equal ones."""
    spread: float = 1.0
    """Radius of a disc as large as the open part of the aperture, in aperture radii."""
    vignetting: float = 0.0
    """See `Aperture`."""
    axial_colour: float = 0.0
    """See `Aperture`."""
    matte_box: tuple[float, float] = (0.0, 0.0)
    """`Aperture.matte_box_sides` and `matte_box_top`."""
    aberrations: Aberrations = NO_ABERRATIONS

    def placed(self, samples: ApertureSamples) -> Views:
        """Place the views on the aperture, with the focal plane exactly in register."""
        offsets = self.lens.sheared_positions(self.lens.radius * samples.positions)
        registration = exact_registration(self.canvas, offsets, self.lens.focus)
        return replace(
            self, offsets=offsets, registration=registration, weights=samples.weights, spread=samples.spread
        )

    @property
    def is_cut(self) -> bool:
        """Return whether the aperture is cut toward the border of the picture."""
        return bool(self.vignetting or any(self.matte_box))

    @property
    def reach(self) -> float:
        """Radius in pixels of the blur discs of infinitely far points on the axis."""
        return float(self.lens.radius * self.canvas.pinhole.fx * self.lens.axis)

    @property
    def half_diagonal(self) -> float:
        """Half of the picture's diagonal, in pixels."""
        return float(np.hypot(self.canvas.pinhole.width, self.canvas.pinhole.height) / 2)

    @property
    def places(self) -> Floats:
        """(N, 2) positions of the views on the aperture, in its radii."""
        return self.lens.aperture_positions(self.offsets) / self.lens.radius

    def field_places(self, xy: Floats) -> Floats:
        """Return places (..., 2) in the picture of pixels (..., 2), in halves of its diagonal."""
        return np.asarray((xy - self.canvas.pinhole.principal_point) / self.half_diagonal)

    def discs(self, displacement: Map, xy: Floats | None = None) -> Map:
        """Return signed radii (h, w) in pixels of the blur discs of displacements (h, w), with aberrations.

        Their places are the pixels xy (h, w, 2), or else those of a raster with the canvas in its middle.
        """
        if not self.aberrations.is_active:
            return displacement
        if xy is None:
            xy = self.lens.raster_places(displacement.shape)
        return self.aberrations.radius(displacement, self.field_places(xy), self.reach)

    @property
    def axial_shift(self) -> float:
        """Inverse depth, 1 / scene units, by which `RED_AND_BLUE` are focused farther away than green."""
        return self.axial_colour * self.lens.axis
