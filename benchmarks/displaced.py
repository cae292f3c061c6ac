"""Vertices of a mesh in the views of a plan, in float64: what the shader of `gpu_views` draws."""

from __future__ import annotations

import numpy as np

from addon.core.base.arrays import Floats
from addon.core.frame.plan import FramePlan


def displaced(plan: FramePlan, xy: Floats, inverse_depth: Floats) -> Floats:
    """Project vertices (V, 2) of inverse depths (V,) into a plan's views (N, V, 2), after registration."""
    moved = xy - (plan.canvas.pinhole.focal * plan.offsets)[:, None, :] * inverse_depth[:, None]
    turned = np.einsum("nij,nvj->nvi", plan.registration[:, :, :2], moved)
    seen = np.asarray(turned + plan.registration[:, None, :, 2])
    if not plan.aberrations.is_active:
        return seen
    return seen + plan.reach * plan.aberrations.shift(plan.places[:, None], plan.field_places(seen))
