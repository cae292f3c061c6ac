"""The lens of the settings: focus, and an aperture that keeps its size over the clip.

One amount is stored: the blur until an aperture is set, from then on the aperture's radius, which an f-stop
sets, too. The others are computed from it whenever they are read. A stored blur is that of the first mark, at
its frame and focus, so the radius is the same in all frames; a keyed blur is that of each frame.
"""

from dataclasses import replace
from typing import Any

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.base.lru_cache import remembered
from ...core.camera.focal_length import Focal, from_equivalent, from_sensor
from ...core.camera.reconstruction import Reconstruction
from ...core.focus.focus import Focus, radius_for_blur
from ...core.frame.options import FRAME_OPTIONS, frame_values
from ...core.frame.plan import FrameOptions
from ..base.option_properties import values_of
from ..base.timeline import clip_frame
from ..solve.camera import curves_of
from ..sources.shot import reconstruction_of
from . import blender_focus
from .repairs import repairs_of
from .scale import scale, sensor_millimetres


def focus_of(settings: bpy.types.PropertyGroup) -> Focus:
    """Return the focus: Blender's own of the camera before that of the settings.

    Without a focus, the result raises when it is used.
    """
    own = focus_of_settings(settings)
    distance = blender_focus.distance(settings)
    return own if distance is None else Focus(distance=distance, tilt=own.tilt, swing=own.swing)


def focus_of_settings(settings: bpy.types.PropertyGroup) -> Focus:
    """Return the focus of the settings: the points of an only mark, else the distance, which may be keyed."""
    return Focus(
        points=() if is_keyed(settings, "focus_distance") else settings.marks.points,
        distance=settings.focus_distance if settings.focus_distance > 0 else None,
        through_points=settings.focus_through_points,
        tilt=settings.focus_tilt,
        swing=settings.focus_swing,
    )


def focus_frame(settings: bpy.types.PropertyGroup) -> int:
    """Return the frame that the blur is chosen at: that of the first mark, or the clip's first."""
    marks = settings.marks.items
    return int(marks[0].frame if len(marks) else settings.clip_first)


def focal_of(settings: bpy.types.PropertyGroup) -> Focal | None:
    """Return the focal length by the settings."""
    if settings.lens == "GIVEN":
        equivalent = settings.equivalent
        return lambda width, height: from_equivalent(equivalent, width, height)
    if settings.lens == "SENSOR":
        focal, sensor = settings.focal_mm, settings.sensor_mm
        return lambda width, _: from_sensor(focal, sensor, width)
    return None


def frame_options(settings: bpy.types.PropertyGroup, reconstruction: Reconstruction) -> FrameOptions:
    """Return the lens that the settings describe; UserError where they mean nothing."""
    blender_focus.check(settings)
    aperture = settings.shape.aperture
    return FrameOptions(
        focus_of(settings), radius_of(settings, reconstruction), aperture=aperture,
        sensor=_sensor(settings) if aperture.breathing else 0.0, repairs=repairs_of(settings),
        **frame_values(values_of(settings, FRAME_OPTIONS)),
    )  # fmt: skip


def _sensor(settings: bpy.types.PropertyGroup) -> float:
    """Return the width of the sensor in scene units; 0 without a scale."""
    metres = scale(settings)
    return sensor_millimetres(settings) / 1000 / metres if metres > 0 else 0.0


def radius_of(settings: bpy.types.PropertyGroup, reconstruction: Reconstruction) -> float:
    """Return the aperture's radius in scene units.

    Raises:
        UserError: It follows from the blur, which has no value.
    """
    if has_radius(settings):
        return stored(settings, "aperture_radius")
    unit = _unit_radius(reconstruction, *_place_of_blur(settings, reconstruction))
    return float(settings.blur * unit)


def _place_of_blur(settings: bpy.types.PropertyGroup, reconstruction: Reconstruction) -> tuple[Focus, int]:
    """The focus and the registered frame that the blur is measured at."""
    frame = focus_frame(settings)
    at = registered(reconstruction, frame)
    if is_keyed(settings, "blur"):
        return focus_of(settings), at
    focus = focus_of_settings(settings)
    distance = _at(settings, "focus_distance", frame)
    if blender_focus.focus_object(settings) is not None:
        distance = settings.object_distance or blender_focus.distance(settings) or 0.0
        focus = replace(focus, points=(), through_points=False)
    tilt, swing = (_at(settings, name, frame) for name in ("focus_tilt", "focus_swing"))
    return replace(focus, distance=distance if distance > 0 else None, tilt=tilt, swing=swing), at


def _at(settings: bpy.types.PropertyGroup, name: str, frame: int) -> float:
    """A number of the settings at a frame, by its keys if it has any."""
    curve = keys_of(settings, name)
    return float(getattr(settings, name) if curve is None else curve.evaluate(frame))


def is_in_focus(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether there is a focus."""
    focus = focus_of(settings)
    return bool(focus.points) or focus.distance is not None


def has_radius(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the aperture's radius is stored; else the blur is."""
    return stored(settings, "aperture_radius") > 0 and not is_keyed(settings, "blur")


def stored(settings: bpy.types.PropertyGroup, name: str) -> float:
    """Return a number as the file has it, where reading it computes another."""
    held: Any = settings.bl_system_properties_get()
    return float(
        settings.bl_rna.properties[name].default
        if held is None
        else held.get(name, settings.bl_rna.properties[name].default)
    )


def is_keyed(settings: bpy.types.PropertyGroup, name: str) -> bool:
    """Return whether a property has keys or a driver."""
    animation, path = settings.id_data.animation_data, settings.path_from_id(name)
    if animation is None:
        return False
    return has_keys(settings, name) or any(driver.data_path == path for driver in animation.drivers)


def has_keys(settings: bpy.types.PropertyGroup, name: str) -> bool:
    """Return whether a property has keys."""
    return keys_of(settings, name) is not None


def keys_of(settings: bpy.types.PropertyGroup, name: str) -> bpy.types.FCurve | None:
    """Return the keys of a property; None where it has none."""
    curves = curves_of(settings.id_data)
    return curves.find(settings.path_from_id(name)) if curves else None


def reset(settings: bpy.types.PropertyGroup) -> None:
    """Reset the lens for a new solve, with other points and scale: no focus, and the blur is stored."""
    settings.focus_distance = 0.0
    store_blur(settings)


def store_blur(settings: bpy.types.PropertyGroup) -> None:
    """Have the blur stored in place of an aperture."""
    settings.property_unset("aperture_radius")
    settings.by_f_stop = False


def shown_blur(settings: bpy.types.PropertyGroup, held: float, _is_set: bool) -> float:
    """Return the blur that is stored, or that of a stored aperture at the present frame and focus."""
    if settings.points is None or not has_radius(settings):
        return held
    try:
        reconstruction = reconstruction_of(settings)
        at = registered(reconstruction, _frame(settings))
        return stored(settings, "aperture_radius") / _unit_radius(reconstruction, focus_of(settings), at)
    except UserError:
        return held


def blur_of_radius(settings: bpy.types.PropertyGroup) -> float:
    """Return the blur that gives the present radius; the stored blur where there is none."""
    try:
        reconstruction = reconstruction_of(settings)
        unit = _unit_radius(reconstruction, *_place_of_blur(settings, reconstruction))
        return radius_of(settings, reconstruction) / unit
    except UserError:
        return float(settings.blur)


def shown_radius(settings: bpy.types.PropertyGroup, held: float, _is_set: bool) -> float:
    """Return the radius that is stored, or that of a stored blur; 0 where that has no value."""
    if held > 0 and not is_keyed(settings, "blur"):
        return held
    try:
        return radius_of(settings, reconstruction_of(settings))
    except UserError:
        return 0.0


@remembered(1)
def _unit_radius(reconstruction: Reconstruction, focus: Focus, frame: int) -> float:
    """The radius of an aperture with a blur of 1 at a frame; UserError where nothing is to be blurred."""
    return radius_for_blur(reconstruction, focus, frame, 1.0)


def distance_now(settings: bpy.types.PropertyGroup) -> float:
    """Return the distance of the focus at the present frame along the optical axis; 0 if it is unknown."""
    if settings.points is None or not is_in_focus(settings):
        return 0.0
    try:
        frame = registered(reconstruction_of(settings), _frame(settings))
    except UserError:
        return 0.0
    return max(distance_at(settings, focus_of(settings), frame), 0.0)


def distance_at(settings: bpy.types.PropertyGroup, focus: Focus, frame: int) -> float:
    """Return the distance of a focus at a registered frame along the optical axis; 0 if it is unknown."""
    try:
        return 1 / focus.inverse_depth(reconstruction_of(settings), frame)
    except UserError:
        return 0.0


def _frame(settings: bpy.types.PropertyGroup) -> int:
    return clip_frame(settings.id_data)


def registered(reconstruction: Reconstruction, frame: int) -> int:
    """Return the registered frame that is nearest; UserError where there is none."""
    frames = reconstruction.frames
    if not len(frames):
        raise UserError("the solve has no frames with a camera; solve the clip again")
    return int(frames[np.abs(frames - frame).argmin()])
