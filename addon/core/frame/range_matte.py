"""Mattes of a range of distances through the lens: the share of each pixel's light that comes from there.

The range is painted on the frame's own mesh and drawn by its own views. So the matte is as blurred as the
picture at every silhouette, and includes the surfaces that an aperture sees behind one.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGB, LinearRGBA, Map
from ..base.options import option
from .detail import painted_by_disparity
from .warped_frame import WarpedFrame

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


def matte_frame(warped: WarpedFrame, wanted: Range) -> WarpedFrame:
    """Paint a frame's mesh with the matte of a range; the mean of its views has it in each channel."""

    def values(displacement: Map) -> LinearRGB:
        return np.dstack([wanted.share(_inverse_depth(warped, displacement))] * 3)

    made = painted_by_disparity(warped, values)
    # A CG object lies at one distance.
    middles = [np.asarray(np.median(each.layer.inverse_depth)) for each in warped.cg]
    cg = [one.painted(float(wanted.share(at))) for one, at in zip(warped.cg, middles, strict=True)]
    return replace(made, cg=tuple(cg))


def matte_of(mean: LinearRGBA, warped: WarpedFrame) -> Map:
    """Return the matte (H, W) in the source frame's geometry from the mean (h, w, 4) of `matte_frame`."""
    drawn = warped.plan.canvas.to_source(mean)
    return np.clip(drawn[..., 0] / np.maximum(drawn[..., 3], LEAST_COVERED), 0, 1).astype(np.float32)


def _inverse_depth(warped: WarpedFrame, displacement: Map) -> Floats:
    """Return the scene's inverse depths (h, w) of a raster of displacements in pixels around the canvas."""
    lens, scale = warped.plan.lens, warped.plan.lens.disparity_scale
    if warped.layers and warped.steadied is not None:
        lens = warped.steadied.own_lens
        scale = warped.steadied.aperture_share * lens.disparity_scale
    inverse: Floats = lens.focus + displacement.astype(np.float64) / scale
    if lens.is_plain:
        return inverse
    return np.asarray(lens.unrectified(inverse, lens.raster_places(inverse.shape)))
