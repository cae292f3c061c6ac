"""Triangles whose sides follow the edges of the picture (section 5.2 of the thesis)."""

from ..features import snapped
from ..mesher import FrameGeometry, Mesher, Surface
from .edge_constrained import edge_mesh


def make(geometry: FrameGeometry) -> Surface:
    """Make a mesh of samples and image edges, extrapolated past the border as far as views see."""
    lens, samples = geometry.lens, snapped(geometry.samples, geometry.lens)
    margin = lens.margin(samples.inverse_depth) + geometry.beyond
    return Surface(
        edge_mesh(samples, geometry.canvas, margin, geometry.picture, lens.disparity_scale), geometry.picture
    )


MESHER = Mesher("edges", 4, "Triangles along image edges (thesis, section 5.2)", make)
