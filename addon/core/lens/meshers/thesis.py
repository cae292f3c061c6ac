"""The thesis's own method, the baseline: pinned corners, random positions, fitted registration."""

from __future__ import annotations

from ...depth.sparse import frame_features
from ...warp.mesh import thesis_mesh
from ..aperture_sampling import random_disc
from ..focus import fitted_registration
from .mesher import FrameGeometry, Mesher, Surface, Views


def make(geometry: FrameGeometry) -> Surface:
    """Delaunay triangles of the features and the picture's corners, pinned (section 3.4)."""
    features = frame_features(geometry.clip.reconstruction, geometry.frame, geometry.canvas)
    return Surface(thesis_mesh(features, geometry.canvas), geometry.picture)


def views(geometry: FrameGeometry, count: int, variant: int = 0) -> Views:
    """Random positions (section 3.5), brought into register by the picked points (section 3.8).

    They lie on a disc, whatever the aperture's shape is.
    """
    reconstruction, settings = geometry.clip.reconstruction, geometry.settings
    offsets = geometry.lens.radius * random_disc(count, settings.seed + variant)
    features = frame_features(reconstruction, geometry.frame, geometry.canvas)
    return Views(
        offsets, fitted_registration(reconstruction, features, geometry.canvas, offsets, settings.focus)
    )


MESHER = Mesher(
    "thesis", 1, "The 2010 baseline: pinned corners, random positions, fitted registration", make, views,
    takes_tilt=False, uses_given_depth=False, fewest_focus_points=2, settings=("seed",),
)  # fmt: skip
