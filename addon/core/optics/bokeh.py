"""Pictures of an aperture for panels and lists: a point of light far behind the focal plane."""

import numpy as np

from ..base.arrays import Floats, LinearRGB
from .aberrations import Aberrations, scattered
from .aperture import RED_AND_BLUE, Aperture

MARGIN = 1.12
"""Half of the picture's side, in radii of the aperture. Chosen by inspection."""
BRIGHTEST = 99
"""Per cent of the open places that are no brighter than white: less than a soap bubble's rim."""
RAYS = 4
"""Rays along a pixel of a disc with aberrations."""
CORNER = float(np.sqrt(0.5))
"""Half of the side of the square frame in which cat's eyes are shown, in half-diagonals."""


def barrel_share(x: Floats, y: Floats, edge: float) -> Floats:
    """Return the transmission (...), 0 to 1, of a barrel's opening at positions x, y (...) in its radii.

    It falls at the rim over a width of twice `edge`.
    """
    return np.asarray(np.clip((1 + edge - np.hypot(x, y)) / (2 * edge), 0, 1))


def matte_box_share(x: Floats, y: Floats, edge: float) -> Floats:
    """Return the transmission (...) of an opening that is a square around the aperture, as `barrel_share`."""
    across, down = (np.clip((1 + edge - np.abs(at)) / (2 * edge), 0, 1) for at in (x, y))
    return np.asarray(across * down)


def bokeh_picture(aperture: Aperture, size: int) -> LinearRGB:
    """Return (size, size, 3) light, 0 to 1, linear, top row first: the blur disc of the aperture on black.

    It is the light over which the virtual cameras are sampled. With an effect that grows toward the border
    there are nine discs, as large as fit, at the middle, the edges and the corners of a square frame.
    """
    box = aperture.matte_box_sides, aperture.matte_box_top
    is_bent = Aberrations.of(aperture).is_active or aperture.field_curvature != 0
    places = (-CORNER, 0.0, CORNER) if aperture.vignetting or any(box) or is_bent else (0.0,)
    side = size // len(places)
    margin = round(side * (1 - 1 / MARGIN) / 2)
    cells = side - 2 * margin
    picture, white = np.zeros((size, size, 3), np.float32), 0.0
    first = (size - side * len(places)) // 2 + margin
    # At infinity the discs of colours that focus farther away are smaller, and brighter.
    discs = {1.0: [0, 1, 2]} | ({1 - aperture.axial_colour: RED_AND_BLUE} if aperture.axial_colour else {})
    for scale, channels in discs.items():
        if is_bent:
            light = _bent(aperture, cells, scale, (0.0, 0.0))
        else:
            light = aperture.raster(cells, scale)[0] / scale**2
        white = max(white, float(np.percentile(light[light > 0], BRIGHTEST)))
        at = ((np.arange(cells) + 0.5) * 2 / cells - 1) / scale
        x, y = np.meshgrid(at, at)
        for row, down in enumerate(places):
            for column, across in enumerate(places):
                left, top = (first + n * side for n in (column, row))
                if is_bent:
                    disc = _bent(aperture, cells, scale, (across, down))
                else:
                    disc = light * _passed(aperture, x, y, (across, down), 1 / cells)
                picture[top : top + cells, left : left + cells, channels] = disc[..., None]
    return np.asarray(np.minimum(picture / white, 1), np.float32)


def _bent(aperture: Aperture, cells: int, scale: float, h: tuple[float, float]) -> Floats:
    """Return the light (cells, cells) of a disc with aberrations at a place in halves of the diagonal."""
    bends, place = Aberrations.of(aperture), np.array(h)
    at = (np.arange(RAYS * cells) + 0.5) * 2 / (RAYS * cells) - 1
    p = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    light = aperture.light(p[:, 0], p[:, 1]) * _passed(aperture, p[:, 0], p[:, 1], h, 1 / cells)
    seen = (scale + aperture.field_curvature * (place @ place)) * p + bends.shift(p, place)
    fit = 1 + abs(aperture.field_curvature) + bends.largest
    return scattered(seen * cells / 2 / fit, light, cells) / RAYS**2 * fit**2


def _passed(aperture: Aperture, x: Floats, y: Floats, h: tuple[float, float], edge: float) -> Floats | float:
    """Return the transmission (...) of barrel and matte box for places x, y (...), in radii."""
    (across, down), barrel = h, aperture.vignetting
    passed = barrel_share(x + barrel * across, y + barrel * down, edge) if barrel else 1.0
    if not (aperture.matte_box_sides or aperture.matte_box_top):
        return passed
    cut = x + aperture.matte_box_sides * across / CORNER, y + aperture.matte_box_top * down / CORNER
    return passed * matte_box_share(*cut, edge)
