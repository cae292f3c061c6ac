"""Focal lengths in pixels from the figures on lenses and in data sheets."""

import math
from collections.abc import Callable

from ..base.errors import UserError

DIAGONAL_35 = math.hypot(36.0, 24.0)
"""Millimetres across the film that 35 mm equivalents speak of."""
PLAUSIBLE = (5.0, 4000.0)
"""Millimetres: 35 mm equivalents that a lens can have, 153 degrees to 0.6 across the diagonal. The longest
zooms of cameras have 3000; a clip of three walls is solved at 3900, at 8100 OpenCV's pose solver fails."""
Focal = float | Callable[[int, int], float]
"""A focal length in pixels, or a function of a clip's width and height."""


def in_pixels(focal: Focal, width: int, height: int) -> float:
    """Return a focal length in pixels for a clip of this size; UserError where no lens has it."""
    pixels = _positive("focal length", focal(width, height) if callable(focal) else focal, "pixels")
    if not is_plausible(pixels, width, height):
        equivalent = pixels / math.hypot(width, height) * DIAGONAL_35
        raise UserError(
            f"the focal length is {pixels:.6g} pixels of {width}x{height}, a 35 mm equivalent of"
            f" {equivalent:.4g} mm; lenses have {PLAUSIBLE[0]:g} to {PLAUSIBLE[1]:g}"
        )
    return pixels


def from_field_of_view(degrees: float, width: int) -> float:
    """Return a focal length from the horizontal field of view in degrees.

    Raises:
        UserError: It is not between 0 and 180.
    """
    if not 0 < degrees < 180:
        raise UserError(f"the field of view is {degrees:g} degrees; it must be between 0 and 180")
    return width / 2 / math.tan(math.radians(degrees) / 2)


def from_equivalent(millimetres: float, width: int, height: int) -> float:
    """Return a focal length from the 35 mm equivalent of the diagonal; UserError unless it is above zero."""
    return _positive("focal length", millimetres, "mm") / DIAGONAL_35 * math.hypot(width, height)


def is_plausible(focal: float, width: int, height: int) -> bool:
    """Return whether a focal length in pixels gives a realistic field of view at this size."""
    return PLAUSIBLE[0] < focal / math.hypot(width, height) * DIAGONAL_35 < PLAUSIBLE[1]


def from_sensor(focal_mm: float, sensor_mm: float, width: int) -> float:
    """Return a focal length from the lens's own and the width of the sensor, all of which the clip shows.

    Both are in millimetres; UserError unless they are above zero.
    """
    return _positive("focal length", focal_mm, "mm") / _positive("sensor", sensor_mm, "mm") * width


def _positive(what: str, value: float, unit: str) -> float:
    if not 0 < value < math.inf:
        raise UserError(f"the {what} is {value:g} {unit}; it must be greater than zero")
    return value
