"""Vertices of a mesh in the views of a frame, in float64: what the shader of `gpu_views` draws."""

from __future__ import annotations

import numpy as np

from addon.core.base.arrays import Floats
from addon.core.frame.views import Views


def displaced(views: Views, xy: Floats, inverse_depth: Floats) -> Floats:
    """Project vertices (V, 2) of inverse depths (V,) into views (N, V, 2), after registration."""
    moved = xy - (views.canvas.pinhole.focal * views.offsets)[:, None, :] * inverse_depth[:, None]
    turned = np.einsum("nij,nvj->nvi", views.registration[:, :, :2], moved)
    seen = np.asarray(turned + views.registration[:, None, :, 2])
    if not views.aberrations.is_active:
        return seen
    return seen + views.reach * views.aberrations.shift(views.places[:, None], views.field_places(seen))
