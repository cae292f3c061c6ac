"""Blender's own depth of field of the solved clip's camera, `Camera.dof`.

An object in focus there is in focus here, too. The focus distance follows ours by a driver, so that Cycles
renders and the viewport show it; it has no influence.
"""

import bpy

from ...core.base.errors import UserError
from ..base.events import at
from ..base.timeline import clip_frame
from ..gpu import main_thread
from ..solve.camera import curves_of

PATH = "dof.focus_distance"
"""Path of the property in a camera's data."""


def distance(settings: bpy.types.PropertyGroup) -> float | None:
    """Return the depth in scene units of the camera's focus object at the present frame.

    It is along the optical axis, negative behind the camera; None without an object. Evaluated settings give
    the evaluated depth.
    """
    camera, thing = _camera(settings), focus_object(settings)
    if camera is None or thing is None:
        return None
    # The root may be scaled: within it lengths are the reconstruction's.
    return -float((camera.matrix_world.inverted_safe() @ thing.matrix_world.translation).z)


def follow(settings: bpy.types.PropertyGroup) -> None:
    """Have the camera's own focus distance follow that of the settings, unless the user animates it."""
    camera = _camera(settings)
    if camera is None or is_animated(settings):
        return
    driver = camera.data.driver_add(PATH).driver
    distance, scale = driver.variables.new(), driver.variables.new()
    distance.name, scale.name, scale.type = "distance", "scale", "TRANSFORMS"
    followed = distance.targets[0]
    followed.id_type, followed.id = "SCENE", settings.id_data
    followed.data_path = settings.path_from_id("focus_distance")
    # The root may be scaled: Blender's lengths are the scene's.
    scale.targets[0].id, scale.targets[0].transform_type = settings.root, "SCALE_AVG"
    driver.expression = "distance * scale"


def is_animated(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the camera's own focus distance has keys or a driver, ours or another."""
    camera = _camera(settings)
    if camera is None or camera.data.animation_data is None:
        return False
    curves = [*camera.data.animation_data.drivers, *curves_of(camera.data)]
    return any(curve.data_path == PATH for curve in curves)


def focus_object(settings: bpy.types.PropertyGroup) -> bpy.types.Object | None:
    """Return the object that is in focus, if one is."""
    camera = _camera(settings)
    return None if camera is None else camera.data.dof.focus_object


def check(settings: bpy.types.PropertyGroup) -> None:
    """Check that the camera's focus object lies ahead; UserError if it does not."""
    thing, away = focus_object(settings), distance(settings)
    if thing is not None and away is not None and not away > 0:
        raise UserError(
            f"the focus object {thing.name} is not in front of the camera at frame"
            f" {clip_frame(settings.id_data)}; move it, or clear Object under Focus and Lens"
        )


def release(settings: bpy.types.PropertyGroup) -> str:
    """Take the object out of focus, so that what is set next is; its name, or an empty string."""
    thing = focus_object(settings)
    if thing is None:
        return ""
    settings.camera.data.dof.focus_object = None
    return str(thing.name)


@at("depsgraph_update_post")
def _on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """Note how far away an object is that is put in focus in the camera's properties, without an event."""
    settings = scene.virtual_aperture
    thing = focus_object(settings)
    name = "" if thing is None else thing.name_full
    if settings.object_name == name:
        return
    # A render's data are its own, on whichever thread.
    if main_thread.is_here() and not bpy.app.is_job_running("RENDER"):
        away = distance(settings)
        settings.object_name, settings.object_distance = name, max(away or 0.0, 0.0)
        # Properties without a callback do not have the scene evaluated.
        scene.update_tag()


def _camera(settings: bpy.types.PropertyGroup) -> bpy.types.Object | None:
    camera = settings.camera
    return camera if camera is not None and camera.type == "CAMERA" else None
