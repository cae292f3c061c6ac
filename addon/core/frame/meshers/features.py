"""One coarse mesh over the samples of a frame's depth."""

from dataclasses import replace

from ...depth.sparse import DepthSamples
from ...optics.thin_lens import ThinLens
from ...warp.layer import Layer
from ...warp.mesh import feature_mesh
from ..frame import Frame, Mesher


def snapped(samples: DepthSamples, lens: ThinLens) -> DepthSamples:
    """Move inverse depths into the focal plane where their blur is invisible."""
    return replace(samples, inverse_depth=lens.snap_to_focal_plane(samples.inverse_depth))


def make(frame: Frame) -> tuple[Layer, ...]:
    """Triangulate the samples, extrapolated past the border as far as views see."""
    samples = snapped(frame.samples, frame.lens)
    margin = frame.lens.margin(samples.inverse_depth) + frame.beyond
    return (Layer(feature_mesh(samples, frame.canvas, margin), frame.picture),)


MESHER = Mesher(
    "features", 0, "One coarse mesh over the feature points, extended past the border: fast", make
)
