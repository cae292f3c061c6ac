"""Camera formats, and metres that a unit of the scene is long: as given, guessed by people, or assumed."""

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.base.lru_cache import remembered
from ...core.camera.reconstruction import Reconstruction
from ..solve.camera import SENSOR
from ..sources.shot import reconstruction_of

NORMAL, PORTRAIT = 50.0, 2.0
"""Millimetres on a full frame, and metres: lens and distance of an assumed scale. Presets of lenses are
defined at this distance, too."""
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


def sensor_millimetres(settings: bpy.types.PropertyGroup) -> float:
    """Return the width of the sensor: the given one, or that of the format of the f-stop."""
    return float(settings.sensor_mm) if settings.lens == "SENSOR" else width(settings.f_stop_format)


def scale(settings: bpy.types.PropertyGroup) -> float:
    """Metres that a unit of the scene is long: as given, else guessed, else assumed; 0 without a solve."""
    try:
        return known_scale(settings) or _assumed_for(reconstruction_of(settings))
    except UserError:
        return 0.0


def known_scale(settings: bpy.types.PropertyGroup) -> float:
    """Metres that a unit of the scene is long: as given, else by the people in the clip; else 0."""
    return float(settings.metres_per_unit) or float(settings.guessed_scale)


@remembered(1)
def _assumed_for(reconstruction: Reconstruction) -> float:
    """Metres per unit with which an f-stop blurs as photographers know it from a normal lens.

    A far background's disc is f^2 / (N s) on the sensor, for a subject at s: with s in proportion to f^2 it
    is that of the f-stop N alone. So the feature points are taken to be, in the median, 2 m away from a lens
    of 50 mm, and 0.5 m from a phone's of 26 mm. It is of the solve alone: no focus or frame changes it.
    """
    cameras = [reconstruction.intrinsics(image) for image in reconstruction.images]
    if not (depth := reconstruction.typical_depth) > 0:
        return 0.0
    millimetres = SENSOR * float(np.median([camera.fx / camera.width for camera in cameras]))
    return PORTRAIT * (millimetres / NORMAL) ** 2 / depth
