"""Camera formats by name, whose f-stops the user knows."""

from __future__ import annotations

from ..solve.camera import SENSOR

FULL_FRAME = "FULL_FRAME"
FORMATS = {
    "ALEXA_65": ("65 mm Digital", 54.12, "ALEXA 65"),
    "MEDIUM": ("Medium Format 44 x 33", 43.8, "GFX, X2D"),
    FULL_FRAME: ("Full Frame", SENSOR, "Stills cameras, VENICE"),
    "SUPER_35": ("Super 35", 24.89, "Film, and cinema cameras with a 4-perforation gate"),
    "APS_C": ("APS-C", 23.5, "Sony, Fujifilm, Nikon"),
    "APS_C_CANON": ("APS-C (Canon)", 22.3, "EOS R7, R10, R50"),
    "FOUR_THIRDS": ("Four Thirds", 17.3, "GH7, OM-1"),
    "ONE_INCH": ("1 Inch", 13.2, "RX100, camcorders"),
    "SUPER_16": ("Super 16", 12.52, "Film, Bolex"),
    "PHONE_LARGE": ("Phone, 1/1.28 Inch", 9.8, "Main cameras since 2022"),
    "PHONE": ("Phone, 1/2.55 Inch", 5.6, "Main cameras until 2018, and telephoto ones"),
}
"""Label, width in millimetres as makers state it, and cameras that have it, by identifier."""


def width(identifier: str) -> float:
    """Return the width of a format in millimetres."""
    return FORMATS[identifier][1]
