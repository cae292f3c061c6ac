"""Focal lengths in pixels from what is written on lenses and in data sheets."""

from __future__ import annotations

import math

from .errors import UserError

DIAGONAL_35 = math.hypot(36.0, 24.0)
"""Millimetres across the film that 35 mm equivalents speak of."""


def from_field_of_view(degrees: float, width: int) -> float:
    """From the horizontal field of view; UserError unless it is between 0 and 180 degrees."""
    if not 0 < degrees < 180:
        raise UserError(f"the field of view is {degrees:g} degrees; it must be between 0 and 180")
    return width / 2 / math.tan(math.radians(degrees) / 2)


def from_equivalent(millimetres: float, width: int, height: int) -> float:
    """From the 35 mm equivalent, which compares diagonals, as phones and EXIF do."""
    if not millimetres > 0:
        raise UserError(f"the focal length is {millimetres:g} mm; it must be greater than zero")
    return millimetres / DIAGONAL_35 * math.hypot(width, height)
