"""Pictures of an aperture for panels and lists: a point of light far behind the focal plane."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Floats, LinearRGB
from .aperture import RED_AND_BLUE, Aperture

MARGIN = 1.12
"""Half of the picture's side, in radii of the aperture. Chosen by inspection."""
BRIGHTEST = 99
"""Per cent of the open places that are no brighter than white: less than a soap bubble's rim."""
CORNER = float(np.sqrt(0.5))
"""Half of the side of the square frame in which cat's eyes are shown, in half-diagonals."""


def barrel_share(x: Floats, y: Floats, edge: float) -> Floats:
    """Return the transmission (...), 0 to 1, of a barrel's opening at positions x, y (...) in its radii.

    It falls at the rim over a width of twice `edge`.
    """
    return np.asarray(np.clip((1 + edge - np.hypot(x, y)) / (2 * edge), 0, 1))


def bokeh_picture(aperture: Aperture, size: int) -> LinearRGB:
    """Return (size, size, 3) light, 0 to 1, linear, top row first: the blur disc of the aperture on black.

    It is the light over which the virtual cameras are sampled. With optical vignetting there are nine discs,
    as large as fit, at the middle, the edges and the corners of a square frame.
    """
    places = (-CORNER, 0.0, CORNER) if aperture.vignetting else (0.0,)
    side = size // len(places)
    margin = round(side * (1 - 1 / MARGIN) / 2)
    cells = side - 2 * margin
    shift, picture, white = aperture.vignetting, np.zeros((size, size, 3), np.float32), 0.0
    first = (size - side * len(places)) // 2 + margin
    # At infinity the discs of colours that focus farther away are smaller, and brighter.
    discs = {1.0: [0, 1, 2]} | ({1 - aperture.axial_colour: RED_AND_BLUE} if aperture.axial_colour else {})
    for scale, channels in discs.items():
        light = aperture.raster(cells, scale)[0] / scale**2
        white = max(white, float(np.percentile(light[light > 0], BRIGHTEST)))
        at = ((np.arange(cells) + 0.5) * 2 / cells - 1) / scale
        x, y = np.meshgrid(at, at)
        for row, down in enumerate(places):
            for column, across in enumerate(places):
                left, top = (first + n * side for n in (column, row))
                passed = barrel_share(x + shift * across, y + shift * down, 1 / cells) if shift else 1.0
                picture[top : top + cells, left : left + cells, channels] = (light * passed)[..., None]
    return np.asarray(np.minimum(picture / white, 1), np.float32)
