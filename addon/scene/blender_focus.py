"""Blender's own focus of the solved clip's camera: `Camera.dof`, as users and rigs set it.

An object in `dof.focus_object` is in focus; so is a `dof.focus_distance` that is keyed or driven. Without
either, that distance and the one of our settings are the same number.
"""

from __future__ import annotations

import bpy

from ..core.base.errors import UserError

PATH = "dof.focus_distance"
"""Of a camera's data."""


def distance(settings: bpy.types.PropertyGroup) -> float | None:
    """Depth along the optical axis, in scene units, that Blender's own properties put in focus at the present
    frame, less than zero behind the camera; None where they do not. Evaluated settings give the evaluated
    depth."""
    camera = _camera(settings)
    if camera is None:
        return None
    dof = camera.data.dof
    if dof.focus_object is not None:
        # The root may be scaled: within it lengths are the reconstruction's.
        return -float((camera.matrix_world.inverted_safe() @ dof.focus_object.matrix_world.translation).z)
    if is_animated(settings):
        return float(dof.focus_distance)
    return None


def focus_object(settings: bpy.types.PropertyGroup) -> bpy.types.Object | None:
    """The object that is in focus, if one is."""
    camera = _camera(settings)
    return None if camera is None else camera.data.dof.focus_object


def is_animated(settings: bpy.types.PropertyGroup) -> bool:
    """Whether the camera's own focus distance has keys or a driver."""
    camera = _camera(settings)
    animation = None if camera is None else camera.data.animation_data
    if animation is None:
        return False
    return keys_of(settings) is not None or any(driver.data_path == PATH for driver in animation.drivers)


def keys_of(settings: bpy.types.PropertyGroup) -> bpy.types.FCurve | None:
    """The keys of the camera's own focus distance."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    camera = _camera(settings)
    animation = None if camera is None else camera.data.animation_data
    if animation is None or animation.action is None:
        return None
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    return None if bag is None else bag.fcurves.find(PATH)


def check(settings: bpy.types.PropertyGroup) -> None:
    """UserError where the object in focus does not lie ahead of the camera."""
    thing, away = focus_object(settings), distance(settings)
    if thing is not None and away is not None and not away > 0:
        raise UserError(
            f"the focus object {thing.name} does not lie ahead of the camera at frame"
            f" {settings.id_data.frame_current}; move it, or take it out of the focus"
        )


def release(settings: bpy.types.PropertyGroup) -> str:
    """Take the object out of focus, so that what is set next is; its name. UserError where the camera's own
    distance is animated, which is the user's to delete."""
    if is_animated(settings):
        raise UserError(
            f"the Focus Distance of {settings.camera.name}'s depth of field is keyed or driven, and is in"
            " focus; delete its keys or its driver first"
        )
    thing = focus_object(settings)
    if thing is None:
        return ""
    settings.camera.data.dof.focus_object = None
    return str(thing.name)


def show(settings: bpy.types.PropertyGroup, shown: float) -> None:
    """Write the distance that is in focus to the camera's own property, unless that is animated."""
    camera = _camera(settings)
    if camera is None or not shown > 0 or is_animated(settings):
        return
    if not settings.marks.shown and camera.data.dof.use_dof:
        # An older file, whose user has a depth of field of their own.
        return
    if camera.data.dof.focus_distance != shown:
        camera.data.dof.focus_distance = shown
    if settings.marks.shown != shown:
        settings.marks.shown = shown


def edited(settings: bpy.types.PropertyGroup) -> float | None:
    """The camera's own distance, where the user has set it since it was shown; else None."""
    camera = _camera(settings)
    if camera is None or is_animated(settings) or not settings.marks.shown > 0:
        return None
    now = float(camera.data.dof.focus_distance)
    return now if now != settings.marks.shown and now > 0 else None


def _camera(settings: bpy.types.PropertyGroup) -> bpy.types.Object | None:
    camera = settings.camera
    return camera if camera is not None and camera.type == "CAMERA" else None
