"""The content-preserving warp: a regular grid that follows the samples as stiffly as possible."""

from dataclasses import replace

import numpy as np

from ....depth.sparse import FrameFeatures
from ..mesher import FrameGeometry, Mesher, Surface
from .content_preserving import allowed, fading, grid_mesh


def make(geometry: FrameGeometry) -> Surface:
    """Make the grid (Liu et al., "Content-preserving warps for 3D video stabilization", 2009)."""
    lens, samples = geometry.lens, geometry.samples
    weights = np.ones(len(samples.observed))
    if isinstance(samples, FrameFeatures):
        weights = fading(geometry.clip.reconstruction, samples.frame, samples.points)
    span = lens.snap_to_focal_plane(np.array(allowed(samples.inverse_depth, lens.focus)))
    mesh = grid_mesh(samples, weights, geometry.canvas, lens.margin(span) + geometry.beyond, lens.focus)
    # At the end, or a subject in the focal plane would flatten its surroundings.
    mesh = replace(mesh, inverse_depth=lens.snap_to_focal_plane(mesh.inverse_depth))
    return Surface(mesh, geometry.picture)


MESHER = Mesher(
    "grid", 3, "One regular mesh that follows the features as stiffly as the picture allows (Liu 2009)", make
)
