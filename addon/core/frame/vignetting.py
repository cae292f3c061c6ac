"""Optical vignetting by weights of views over the aperture and the picture.

A long barrel cuts the aperture away from the picture's centre. Light passes through the overlap of two discs,
and blur discs towards the corners are cat's eyes (Ray, "Applied photographic optics", 2002, on mechanical
vignetting). The straight edges of a matte box before the lens cut in the same way. Brightness in focus is
kept: the remaining light is normalised.
"""

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..optics.bokeh import barrel_share, matte_box_share
from .views import Views

STEP = 16
"""Pixels between samples of the remaining light: linear interpolation is accurate to a thousandth (test)."""
LEAST_LEFT = 0.05
"""Least remaining share of a pixel's light, or of the views that cover it, that is normalised."""


def view_shares(views: Views) -> Floats:
    """Return (N,) light of the views at the picture's centre, with mean 1."""
    count = len(views.offsets)
    return np.ones(count) if views.weights is None else count * views.weights


def barrel_rows(views: Views) -> Floats:
    """Return the coefficients (N, 5) a, b, c, d, e of each view's transmission.

    It is clip(e (1 + d - |(a + c x, b + c y)|), 0, 1) at (x, y), in pixels from the picture's centre. A view
    stands for a part of the aperture: its light ends over the width of the part.
    """
    across = views.spread / np.sqrt(len(views.offsets))
    rows = np.empty((len(views.offsets), 5))
    rows[:, :2] = views.places
    rows[:, 2] = barrel_shift(views)
    rows[:, 3:] = across, 1 / (2 * across)
    return rows


def barrel_shift(views: Views) -> float:
    """Return the shift of the barrel's opening a pixel from the picture's centre, in aperture radii."""
    return views.vignetting / views.half_diagonal


def matte_box_shift(views: Views) -> Floats:
    """Return the shifts (2,) of a matte box's opening a pixel from the picture's centre, in radii."""
    pinhole = views.canvas.pinhole
    return np.array(views.matte_box) * 2 / [pinhole.width, pinhole.height]


def light_left(views: Views) -> Map:
    """Return the remaining share (h, w) of the aperture's light in the canvas, at least `LEAST_LEFT`."""
    pinhole = views.canvas.pinhole
    size = pinhole.width // STEP + 2, pinhole.height // STEP + 2
    middle = pinhole.principal_point
    # Centres of the coarse raster's cells, as in `cv2.resize`.
    x, y = (
        (np.arange(n) + 0.5) * (whole / n) - centre
        for n, whole, centre in zip(size, (pinhole.width, pinhole.height), middle, strict=True)
    )
    total = np.zeros((size[1], size[0]))
    sides, top = matte_box_shift(views)
    for (a, b, c, d, _), share in zip(barrel_rows(views), view_shares(views), strict=True):
        passed = barrel_share(a + c * x[None, :], b + c * y[:, None], d) if views.vignetting else 1.0
        if any(views.matte_box):
            passed = passed * matte_box_share(a + sides * x[None, :], b + top * y[:, None], d)
        total += share * passed
    left = cv2.resize((total / len(views.offsets)).astype(np.float32), (pinhole.width, pinhole.height))
    return np.asarray(np.maximum(left, np.float32(LEAST_LEFT)), np.float32)
