"""Metres that a unit of the scene is long: as given, guessed by the height of people, or assumed."""

from __future__ import annotations

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ..solve.camera import SENSOR
from ..sources.shot import IDENTITY, reconstruction_of
from . import formats

NORMAL, PORTRAIT = 50.0, 2.0
"""Millimetres on a full frame, and metres: lens and distance of an assumed scale. Presets of lenses are
defined at this distance, too."""


def sensor_millimetres(settings: bpy.types.PropertyGroup) -> float:
    """Return the width of the sensor: the given one, or that of the format of the f-stop."""
    return float(settings.sensor_mm) if settings.lens == "SENSOR" else formats.width(settings.f_stop_format)


def scale(settings: bpy.types.PropertyGroup) -> float:
    """Metres that a unit of the scene is long: as given, else guessed, else assumed; 0 without a solve."""
    return known_scale(settings) or _assumed_scale(settings)


def known_scale(settings: bpy.types.PropertyGroup) -> float:
    """Metres that a unit of the scene is long: as given, else by the people in the clip; else 0."""
    return float(settings.metres_per_unit) or float(settings.guessed_scale)


_assumed: tuple[tuple[object, ...], float] | None = None
"""Panels are drawn often while nothing changes."""


def _assumed_scale(settings: bpy.types.PropertyGroup) -> float:
    """Metres per unit with which an f-stop blurs as photographers know it from a normal lens.

    A far background's disc is f^2 / (N s) on the sensor, for a subject at s: with s in proportion to f^2 it
    is that of the f-stop N alone. So the feature points are taken to be, in the median, 2 m away from a lens
    of 50 mm, and 0.5 m from a phone's of 26 mm. It is of the solve alone: no focus or frame changes it.
    """
    global _assumed
    if settings.points is None or settings.points.type != "MESH":
        return 0.0
    mesh = settings.points.data
    key = (mesh.get(IDENTITY), mesh.session_uid)
    if _assumed is None or _assumed[0] != key:
        try:
            _assumed = key, _assumed_for(reconstruction_of(settings))
        except UserError:
            _assumed = key, 0.0
    return _assumed[1]


def _assumed_for(reconstruction: Reconstruction) -> float:
    cameras = [reconstruction.intrinsics(image) for image in reconstruction.images]
    if not (depth := reconstruction.typical_depth) > 0:
        return 0.0
    millimetres = SENSOR * float(np.median([camera.fx / camera.width for camera in cameras]))
    return PORTRAIT * (millimetres / NORMAL) ** 2 / depth
