"""The aperture in terms of photography: its f-stop, and the sharp range.

A reconstruction has no scale. Once the user gives a length or a distance, `metres_per_unit` of the settings
is known, and the f-stop is focal length / (2 R), both in metres. Until then the scale is guessed by the
height of people, or assumed. Blur, radius and f-stop are three views of one number; the radius R is stored.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.focus import focus as core_focus
from ...core.optics.zone import InFocusZone
from ..base.timeline import clip_frame
from ..solve.camera import SENSOR
from ..sources.shot import IDENTITY, reconstruction_of
from . import formats, lens

NORMAL, PORTRAIT = 50.0, 2.0
"""Millimetres on a full frame, and metres: lens and distance of an assumed scale. Presets of lenses are
defined at this distance, too."""


def focal_metres(settings: bpy.types.PropertyGroup) -> float:
    """Return the camera's focal length in metres at the present frame; 0 without a camera.

    It belongs to the sensor if its width is given, else to a full frame, 36 mm wide, with the same field of
    view.
    """
    if settings.camera is None or settings.camera.type != "CAMERA":
        return 0.0
    data = settings.camera.data
    return float(data.lens / data.sensor_width * sensor_millimetres(settings) / 1000)


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
    depths = [reconstruction.median_depth(image) for image in reconstruction.images]
    if not cameras or not (depth := float(np.median(depths))) > 0:
        return 0.0
    millimetres = SENSOR * float(np.median([camera.fx / camera.width for camera in cameras]))
    return PORTRAIT * (millimetres / NORMAL) ** 2 / depth


def subject_metres(settings: bpy.types.PropertyGroup) -> float:
    """Return the distance of the focus in metres at the present frame, by the given or assumed scale.

    It is 0 without a focus.
    """
    return lens.distance_now(settings) * scale(settings)


def set_subject_metres(settings: bpy.types.PropertyGroup, value: float) -> None:
    """Give the scale by how far away what is in focus is; nothing is changed by 0, nor where nothing is."""
    away = lens.distance_now(settings)
    if value > 0 and away > 0:
        settings.metres_per_unit = value / away


def f_stop(settings: bpy.types.PropertyGroup) -> float:
    """Return the aperture's f-stop by the given or assumed scale; 0 without an aperture."""
    across = 2 * settings.aperture_radius * scale(settings)
    return focal_metres(settings) / across if across > 0 else 0.0


def t_stop(settings: bpy.types.PropertyGroup) -> float:
    """Return the T-stop: the f-stop of a round hole with the light of the aperture's shape; 0 without one.

    Losses in glass are not part of a shape, and left out.
    """
    return f_stop(settings) / math.sqrt(settings.shape.aperture.transmission)


_assumes = True
"""True if an f-stop uses an assumed scale where none is given."""


@contextmanager
def by_given_scale() -> Iterator[None]:
    """Set f-stops within only if the scale is given.

    Presets also have a blur: that of their lens. With an assumed scale the f-stop of a long lens would blur
    as little as on a short one.
    """
    global _assumes
    _assumes = False
    try:
        yield
    finally:
        _assumes = True


def set_f_stop(settings: bpy.types.PropertyGroup, value: float) -> None:
    """Choose the aperture by its f-stop; nothing is changed by 0, nor without a solve."""
    focal = focal_metres(settings)
    metres = scale(settings) if _assumes else known_scale(settings)
    if value > 0 and focal > 0 and metres > 0:
        settings.aperture_radius = focal / (2 * value * metres)


def on_scale(settings: bpy.types.PropertyGroup) -> None:
    """Show lengths in Blender by a scale that was just given."""
    if settings.metres_per_unit > 0:
        settings.id_data.unit_settings.scale_length = settings.metres_per_unit


def forget_scale(settings: bpy.types.PropertyGroup) -> None:
    """Forget the scale: another solve has another one."""
    settings.guessed_scale = 0.0
    if settings.metres_per_unit > 0:
        settings.metres_per_unit = 0.0
        settings.id_data.unit_settings.scale_length = 1.0


def show_in_camera(settings: bpy.types.PropertyGroup) -> None:
    """Set the same aperture in the camera's own depth of field, for Cycles' renders of placed objects.

    Blender takes its lens to be millimetres and the scene's units to be metres.
    """
    if settings.camera is None or settings.camera.type != "CAMERA" or not lens.has_radius(settings):
        return
    scale = settings.root.matrix_world.median_scale if settings.root is not None else 1.0
    across = 2 * settings.aperture_radius * scale
    if across > 0:
        settings.camera.data.dof.aperture_fstop = settings.camera.data.lens / 1000 / across


_last: tuple[tuple[object, ...], tuple[float, float] | None] | None = None
"""Panels are drawn often while nothing changes."""


def sharp_distances(settings: bpy.types.PropertyGroup) -> tuple[float, float] | None:
    """Nearest and farthest sharp distance at the present frame in scene units, infinity included.

    `ThinLens.sharp_distances` has the rule. None where nothing is in focus.
    """
    global _last
    if settings.points is None or not lens.is_in_focus(settings):
        return None
    frame, focus = clip_frame(settings.id_data), lens.focus_of(settings)
    zone = lens.zone_of(settings)
    chosen = settings.aperture_radius if lens.has_radius(settings) else (settings.blur, settings.focus_frame)
    mesh = settings.points.original.data
    key = (mesh.get(IDENTITY), mesh.session_uid, frame, focus, zone, chosen)
    if _last is None or _last[0] != key:
        _last = key, _sharp_distances(settings, focus, zone, frame)
    return _last[1]


def _sharp_distances(
    settings: bpy.types.PropertyGroup, focus: core_focus.Focus, zone: InFocusZone, frame: int
) -> tuple[float, float] | None:
    try:
        reconstruction = reconstruction_of(settings)
        radius = lens.radius_of(settings, reconstruction)
        return core_focus.sharp_distances(
            reconstruction, focus, lens.registered(reconstruction, frame), radius, zone
        )
    except UserError:
        # A render reports the error.
        return None


def sharp_words(settings: bpy.types.PropertyGroup) -> str:
    """Between which distances the picture is sharp, in a line; empty where nothing is in focus."""
    found = sharp_distances(settings)
    if found is None:
        return ""
    near, far = found
    where = " on the optical axis" if lens.focus_of(settings).is_tilted else ""
    if math.isinf(near):
        return "Nothing is sharp"
    first, last = (length_words(settings, distance) for distance in (near, far))
    return f"Sharp{where}: {first} and farther" if math.isinf(far) else f"Sharp{where}: {first} to {last}"


def length_words(settings: bpy.types.PropertyGroup, length: float) -> str:
    """Return a length in scene units like the scene's other lengths.

    It is a bare number while the scale is unknown.
    """
    units = settings.id_data.unit_settings
    if units.system == "NONE" or not settings.metres_per_unit > 0:
        return f"{length:.3g}"
    said: str = bpy.utils.units.to_string(units.system, "LENGTH", length * units.scale_length, precision=3)
    return said
