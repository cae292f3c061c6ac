"""What a point of light far behind the focus looks like: the picture of an aperture in panels and lists."""

from __future__ import annotations

import numpy as np

from ..base.arrays import Floats, Map
from .aperture import Aperture

MARGIN = 1.12
"""Half of the picture's side, in radii of the aperture. By eye."""
BRIGHTEST = 99
"""Per cent of the open places that are no brighter than white: less than a soap bubble's rim."""
CORNER = float(np.sqrt(0.5))
"""Of the frame that cat's eyes are shown in, which is square: half of its side, in half-diagonals."""


def barrel_share(x: Floats, y: Floats, edge: float) -> Floats:
    """Share (...), 0 to 1, of the light that a barrel's opening lets through at places x and y (...) from its
    middle, in shares of its radius; it ends within `edge` on either side of the rim."""
    return np.asarray(np.clip((1 + edge - np.hypot(x, y)) / (2 * edge), 0, 1))


def bokeh_picture(aperture: Aperture, size: int) -> Map:
    """(size, size) light, 0 to 1, linear, top row first: the blur disc of the aperture on black.

    It is the light over which the virtual cameras are sampled. With optical vignetting there are nine discs,
    as large as fit, at the middle, the edges and the corners of a square frame.
    """
    places = (-CORNER, 0.0, CORNER) if aperture.vignetting else (0.0,)
    side = size // len(places)
    margin = round(side * (1 - 1 / MARGIN) / 2)
    cells = side - 2 * margin
    light, _ = aperture.raster(cells)
    at = (np.arange(cells) + 0.5) * 2 / cells - 1
    x, y = np.meshgrid(at, at)
    shift, picture = aperture.vignetting, np.zeros((size, size), np.float32)
    first = (size - side * len(places)) // 2 + margin
    for row, down in enumerate(places):
        for column, across in enumerate(places):
            left, top = (first + n * side for n in (column, row))
            passed = barrel_share(x + shift * across, y + shift * down, 1 / cells) if shift else 1.0
            picture[top : top + cells, left : left + cells] = light * passed
    white = np.percentile(light[light > 0], BRIGHTEST)
    return np.asarray(np.minimum(picture / white, 1), np.float32)
