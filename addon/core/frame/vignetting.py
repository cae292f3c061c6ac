"""Weights of views over the aperture and the picture: optical vignetting.

A long barrel cuts the aperture for places away from the picture's middle. Light passes through the overlap of
two discs, and blur discs towards the corners are cat's eyes (Ray, "Applied photographic optics", 2002, on
mechanical vignetting). Things in focus keep their brightness: the remaining light is normalised.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..optics.bokeh import barrel_share
from .plan import FramePlan

STEP = 16
"""Pixels between two places at which the light that is left is computed: linear in between, it is right to a
thousandth (test)."""
LEAST_LEFT = 0.05
"""Share of the light that must be left at a pixel for its colour to be made whole."""


def view_shares(plan: FramePlan) -> Floats:
    """(N,) light of each view in the picture's middle, their mean 1."""
    count = len(plan.offsets)
    return np.ones(count) if plan.weights is None else count * plan.weights


def barrel_rows(plan: FramePlan) -> Floats:
    """Return the coefficients (N, 5) a, b, c, d, e of each view's transmission.

    It is clip(e (1 + d - |(a + c x, b + c y)|), 0, 1) at a place (x, y), in pixels from the picture's middle.
    A view stands for a part of the aperture: its light ends over the width of the part.
    """
    across = plan.spread / np.sqrt(len(plan.offsets))
    rows = np.empty((len(plan.offsets), 5))
    rows[:, :2] = plan.lens.aperture_positions(plan.offsets) / plan.lens.radius
    rows[:, 2] = barrel_shift(plan)
    rows[:, 3:] = across, 1 / (2 * across)
    return rows


def barrel_shift(plan: FramePlan) -> float:
    """Return the shift of the barrel's opening for each pixel from the picture's middle.

    It is in aperture radii.
    """
    pinhole = plan.canvas.pinhole
    return float(plan.vignetting / (np.hypot(pinhole.width, pinhole.height) / 2))


def light_left(plan: FramePlan) -> Map:
    """(h, w) share of the aperture's light that is left at each pixel of the canvas."""
    pinhole = plan.canvas.pinhole
    size = pinhole.width // STEP + 2, pinhole.height // STEP + 2
    middle = pinhole.principal_point
    # Middles of the coarse raster's cells, as `cv2.resize` has them.
    x, y = (
        (np.arange(n) + 0.5) * (whole / n) - centre
        for n, whole, centre in zip(size, (pinhole.width, pinhole.height), middle, strict=True)
    )
    total = np.zeros((size[1], size[0]))
    for (a, b, c, d, _), share in zip(barrel_rows(plan), view_shares(plan), strict=True):
        total += share * barrel_share(a + c * x[None, :], b + c * y[:, None], d)
    left = cv2.resize((total / len(plan.offsets)).astype(np.float32), (pinhole.width, pinhole.height))
    return np.asarray(left, np.float32)
