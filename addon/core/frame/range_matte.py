"""Mattes of a range of distances through the lens: the share of each pixel's light that comes from there.

The range is painted on the frame's own layers and drawn by its own views. So the matte is as blurred as the
picture at every silhouette, and includes the surfaces that an aperture sees behind one.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGB, LinearRGBA, Map
from ..base.options import option
from .detail import painted_by_disparity
from .frame import Frame

LEAST_COVERED = 1e-3
"""Share of a pixel that some view covers, below which it is empty."""


@dataclass(frozen=True)
class Range:
    """Distances along the camera's axis, in scene units."""

    near: float = option(
        0.0, "Range Near", "Distance from the camera at which the range begins, in scene units",
        name="range_near", least=0.0, soft_most=100.0,
    )  # fmt: skip
    far: float = option(
        0.0, "Range Far", "Distance from the camera at which the range ends, in scene units; 0 for no end",
        name="range_far", least=0.0, soft_most=100.0,
    )  # fmt: skip
    softness: float = option(
        0.1, "Range Softness", "How far past its ends the range fades out, as a share of their distance: 0.1"
        " is up to a tenth nearer or farther",
        name="range_softness", least=0.0, most=1.0, unit="FACTOR", precision=2,
    )  # fmt: skip

    def share(self, inverse_depth: Floats | Map) -> Map:
        """Return the matte, 0 to 1, of inverse depths of any shape."""
        distance = 1 / np.maximum(np.asarray(inverse_depth, np.float64), 1e-12)
        soft = max(self.softness, 1e-9)
        found = np.ones(distance.shape)
        if self.near > 0:
            found = np.minimum(found, 1 - (self.near - distance) / (soft * self.near))
        if self.far > 0:
            found = np.minimum(found, 1 - (distance - self.far) / (soft * self.far))
        return np.clip(found, 0, 1).astype(np.float32)


def matte_frame(frame: Frame, wanted: Range) -> Frame:
    """Paint a frame's layers with the matte of a range; the mean of its views has it in each channel."""

    def values(displacement: Map) -> LinearRGB:
        return np.dstack([wanted.share(_inverse_depth(frame, displacement))] * 3)

    made = painted_by_disparity(frame, values)
    # A CG object lies at one distance.
    middles = [np.asarray(np.median(each.inverse_depth)) for each in frame.cg.layers]
    cg = [one.painted(float(wanted.share(at))) for one, at in zip(frame.cg_layers, middles, strict=True)]
    return replace(made, cg_layers=tuple(cg))


def matte_of(mean: LinearRGBA, frame: Frame) -> Map:
    """Return the matte (H, W) in the source frame's geometry from the mean (h, w, 4) of `matte_frame`."""
    drawn = frame.views.canvas.to_source(mean)
    return np.clip(drawn[..., 0] / np.maximum(drawn[..., 3], LEAST_COVERED), 0, 1).astype(np.float32)


def _inverse_depth(frame: Frame, displacement: Map) -> Floats:
    """Return the scene's inverse depths (h, w) of a raster of displacements in pixels around the canvas."""
    lens, scale = frame.views.lens, frame.views.lens.disparity_scale
    if frame.is_layered and frame.steadied is not None:
        lens = frame.steadied.own_lens
        scale = frame.steadied.aperture_share * lens.disparity_scale
    inverse: Floats = lens.focus + displacement.astype(np.float64) / scale
    if lens.is_plain:
        return inverse
    return np.asarray(lens.unrectified(inverse, lens.raster_places(inverse.shape)))
