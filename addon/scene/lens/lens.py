"""The lens of the settings: focus, and an aperture that keeps its size.

Blur and aperture radius are two views of one value: the blur at one frame, with its focus; the radius for the
whole clip. A chosen radius is stored: the blur is computed from it whenever it is read, for the present frame
and focus, and editing it sets the radius. A keyed blur counts at every frame. The stored blur is the last
wished one: it counts without a focus, or without a chosen radius.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.camera.focal_length import Focal, from_equivalent, from_sensor
from ...core.camera.reconstruction import Reconstruction
from ...core.focus.focus import Focus, blur_for_radius, radius_for_blur
from ...core.frame.options import FRAME_OPTIONS, frame_values
from ...core.frame.plan import FrameOptions
from ...core.optics.zone import InFocusZone
from ..base.option_properties import values_of
from ..base.timeline import clip_frame
from ..sources.shot import IDENTITY, reconstruction_of
from . import blender_focus
from .repairs import repairs_of
from .scale import scale, sensor_millimetres

BLUR_DIGITS = 4
"""Decimals that the field of the blur shows."""
EDITED_DIGITS = 6
"""Decimals of a number that Blender shows while its field is edited."""
_writing = False


@contextmanager
def writing() -> Iterator[None]:
    """Write properties of the lens within without effects on each other; the blur is the stored number."""
    global _writing
    before, _writing = _writing, True
    try:
        yield
    finally:
        _writing = before


def is_writing() -> bool:
    """Return whether `writing` is active."""
    return _writing


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


def zone_of(settings: bpy.types.PropertyGroup) -> InFocusZone:
    """Return the in-focus zone that the settings describe."""
    return InFocusZone(
        settings.zone_front, settings.zone_behind, settings.blur_in_front, settings.blur_behind
    )


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
        return float(settings.aperture_radius)
    frame = focus_frame(settings)
    if frame not in reconstruction.frames:
        frame = int(reconstruction.frames[0])
    return radius_for_blur(reconstruction, focus_of(settings), frame, settings.blur)


def is_in_focus(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether there is a focus."""
    focus = focus_of(settings)
    return bool(focus.points) or focus.distance is not None


def has_radius(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the aperture's radius counts; else the blur does."""
    return bool(settings.aperture_radius > 0) and not is_keyed(settings, "blur")


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
    bag = channels_of(settings)
    return None if bag is None else bag.fcurves.find(settings.path_from_id(name))


def channels_of(settings: bpy.types.PropertyGroup) -> bpy.types.ActionChannelbag | None:
    """Return the F-curves of the scene; None without any."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    animation = settings.id_data.animation_data
    if animation is None or animation.action is None:
        return None
    return action_get_channelbag_for_slot(animation.action, animation.action_slot)


def key_distance(settings: bpy.types.PropertyGroup, distance: float) -> None:
    """Key a distance at the present frame."""
    settings.focus_distance = distance
    settings.id_data.keyframe_insert(settings.path_from_id("focus_distance"), frame=_frame(settings))


def choose_aperture(settings: bpy.types.PropertyGroup) -> None:
    """Choose the aperture of a first focus, from the blur; a later one looks through the same lens."""
    if settings.follows_blur or not settings.aperture_radius > 0:
        _store_radius(settings, focus_frame(settings))
    settings.follows_blur = False


def reset(settings: bpy.types.PropertyGroup) -> None:
    """Reset the lens for a new solve, with other points and another scale: no focus, and the blur counts."""
    with writing():
        settings.focus_distance = settings.aperture_radius = 0.0
        settings.follows_blur = False


def set_aperture(settings: bpy.types.PropertyGroup, radius: float, blur: float | None) -> None:
    """Choose the aperture's radius, and the wished blur; by default the radius gives the blur."""
    with writing():
        settings.aperture_radius, settings.follows_blur = radius, False
        settings.blur = _blur_at(settings, focus_frame(settings)) or settings.blur if blur is None else blur


def blur_now(settings: bpy.types.PropertyGroup, stored: float) -> float:
    """Return the blur of the radius at the present frame and focus.

    It is the stored number if that counts, without a focus, and within `writing`.
    """
    if is_writing() or not has_radius(settings):
        return stored
    return _blur_at(settings, _frame(settings)) or stored


def blur_percent(settings: bpy.types.PropertyGroup) -> float:
    """Return the blur of the present frame and focus in per cent of the picture's width."""
    return float(100 * settings.blur)


def set_blur_percent(settings: bpy.types.PropertyGroup, value: float) -> None:
    """Choose the blur in per cent of the picture's width; the shown number, typed again, changes nothing."""
    shown = blur_percent(settings)
    digits = range(BLUR_DIGITS - 2, EDITED_DIGITS + 1)
    if any(np.float32(value) == np.float32(round(shown, each)) for each in digits):
        return
    settings.blur = value / 100


def on_blur(settings: bpy.types.PropertyGroup) -> None:
    """Set the radius from an edited blur, with the present focus at the present frame.

    The shown number, typed again, changes nothing.
    """
    now = _blur_at(settings, _frame(settings)) if has_radius(settings) else None
    if now is not None and _is_as_shown(settings.blur, now):
        return
    settings.follows_blur = False
    _store_radius(settings, _frame(settings))


def on_radius(settings: bpy.types.PropertyGroup) -> None:
    """Set the wished blur from an edited radius."""
    settings.follows_blur = False
    settings.blur = _blur_at(settings, _frame(settings)) or settings.blur


def on_focus(settings: bpy.types.PropertyGroup) -> None:
    """Keep the aperture after the focus was moved by hand, and choose one where there was none.

    While a first distance is dragged, in many edits, the blur is kept and the radius follows; at another
    frame the edit is a pull, and the lens is unchanged.
    """
    frame = _frame(settings)
    chosen = settings.aperture_radius > 0
    if not chosen and not settings.marks.points:
        settings.follows_blur = True
    elif frame != focus_frame(settings):
        settings.follows_blur = False
    if settings.follows_blur or not chosen:
        _store_radius(settings, frame)


def _store_radius(settings: bpy.types.PropertyGroup, frame: int) -> None:
    try:
        reconstruction = reconstruction_of(settings)
        at = registered(reconstruction, frame)
        radius = radius_for_blur(reconstruction, focus_of(settings), at, settings.blur)
    except UserError:
        # The next focus chooses it; a render before reports the error.
        radius = 0.0
    settings.aperture_radius = radius


_last: tuple[tuple[object, ...], float | None] | None = None
"""Panels are drawn often while nothing changes."""


def _blur_at(settings: bpy.types.PropertyGroup, frame: int) -> float | None:
    """The blur of the aperture's radius at a frame, with the present focus; None without one."""
    global _last
    if settings.points is None:
        return None
    mesh = settings.points.original.data
    key = (mesh.get(IDENTITY), mesh.session_uid, frame, focus_of(settings), settings.aperture_radius)
    if _last is None or _last[0] != key:
        try:
            reconstruction = reconstruction_of(settings)
            at = registered(reconstruction, frame)
            radius = settings.aperture_radius
            _last = key, blur_for_radius(reconstruction, focus_of(settings), at, radius)
        except UserError:
            _last = key, None
    return _last[1]


def _is_as_shown(typed: float, now: float) -> bool:
    """Return whether a number is the present blur as a field shows it, rounded or to the last digit."""
    return any(
        np.float32(typed) == np.float32(each)
        for each in (now, *(round(now, digits) for digits in range(BLUR_DIGITS, EDITED_DIGITS + 1)))
    )


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
