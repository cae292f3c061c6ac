"""The aperture in terms of photography: its f-stop, and the sharp range.

A reconstruction has no scale. Once the user gives a length or a distance, `metres_per_unit` of the settings
is known, and the f-stop is focal length / (2 R), both in metres. Until then `scale` guesses or assumes it.
Blur, radius and f-stop are three views of one number (`lens`).
"""

import math

import bpy

from ...core.base.errors import UserError
from ...core.base.lru_cache import remembered
from ...core.focus import focus as core_focus
from ...core.optics.zone import InFocusZone
from ..base.timeline import clip_frame
from ..sources.shot import reconstruction_of
from . import lens
from .scale import scale, sensor_millimetres


def focal_metres(settings: bpy.types.PropertyGroup) -> float:
    """Return the clip's focal length in metres, a zoom's at its first frame; 0 without a solve.

    It belongs to the sensor if its width is given, else to a full frame, 36 mm wide, with the same field of
    view.
    """
    try:
        reconstruction = reconstruction_of(settings)
    except UserError:
        return 0.0
    camera = reconstruction.intrinsics(reconstruction.images[0])
    return camera.fx / camera.width * sensor_millimetres(settings) / 1000


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


def set_f_stop(settings: bpy.types.PropertyGroup, value: float) -> None:
    """Store the aperture by its f-stop; nothing is changed by 0, nor without a solve."""
    focal, metres = focal_metres(settings), scale(settings)
    if value > 0 and focal > 0 and metres > 0:
        settings.aperture_radius = focal / (2 * value * metres)
        settings.by_f_stop = True


def guess_scale(settings: bpy.types.PropertyGroup, metres: float) -> None:
    """Set the scale that people in the clip have; a stored f-stop is that of the new scale."""
    stop = f_stop(settings) if settings.by_f_stop and not settings.metres_per_unit > 0 else 0.0
    settings.guessed_scale = metres
    set_f_stop(settings, stop)


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
    if settings.camera is None or settings.camera.type != "CAMERA":
        return
    scale = settings.root.matrix_world.median_scale if settings.root is not None else 1.0
    across = 2 * settings.aperture_radius * scale
    if across > 0:
        settings.camera.data.dof.aperture_fstop = settings.camera.data.lens / 1000 / across


_sharp_distances = remembered(1)(core_focus.sharp_distances)
"""Panels are drawn often while nothing changes."""


def sharp_distances(settings: bpy.types.PropertyGroup) -> tuple[float, float] | None:
    """Nearest and farthest sharp distance at the present frame in scene units, infinity included.

    `ThinLens.sharp_distances` has the rule. None where nothing is in focus.
    """
    if settings.points is None or not lens.is_in_focus(settings):
        return None
    try:
        reconstruction = reconstruction_of(settings)
        frame = lens.registered(reconstruction, clip_frame(settings.id_data))
        radius = lens.radius_of(settings, reconstruction)
        zone = InFocusZone(
            settings.zone_front, settings.zone_behind, settings.blur_in_front, settings.blur_behind
        )
        return _sharp_distances(reconstruction, lens.focus_of(settings), frame, radius, zone)
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

    While the scale is unknown it is estimated in metres by the people in the clip, or given in units.
    """
    units, guess = settings.id_data.unit_settings, settings.guessed_scale
    if not settings.metres_per_unit > 0:
        return f"≈ {length * guess:.2g} m" if guess > 0 else f"{length:.3g} units"
    if units.system == "NONE":
        return f"{length:.3g}"
    said: str = bpy.utils.units.to_string(units.system, "LENGTH", length * units.scale_length, precision=3)
    return said
