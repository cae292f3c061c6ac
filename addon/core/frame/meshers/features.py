"""One coarse mesh over the samples of a frame's depth."""

from dataclasses import replace

from ...depth.sparse import DepthSamples
from ...optics.thin_lens import ThinLens
from ...warp.mesh import feature_mesh
from .mesher import FrameGeometry, Mesher, Surface


def snapped(samples: DepthSamples, lens: ThinLens) -> DepthSamples:
    """Move inverse depths into the focal plane where their blur is invisible."""
    return replace(samples, inverse_depth=lens.snap_to_focal_plane(samples.inverse_depth))


def make(geometry: FrameGeometry) -> Surface:
    """Triangulate the samples, extrapolated past the border as far as views see."""
    samples = snapped(geometry.samples, geometry.lens)
    margin = geometry.lens.margin(samples.inverse_depth) + geometry.beyond
    return Surface(feature_mesh(samples, geometry.canvas, margin), geometry.picture)


MESHER = Mesher(
    "features", 0, "One coarse mesh over the feature points, extended past the border: fast", make
)
