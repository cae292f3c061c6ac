"""Cameras of the reconstruction as Blender cameras."""

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.camera.reconstruction import Intrinsics, Reconstruction, quaternion_from_matrix

SENSOR = 36.0
"""Millimetres of the horizontal sensor, Blender's own default."""
INTRINSICS = ("lens", "shift_x", "shift_y")
"""Properties of a camera that are keyed where the intrinsics change."""
FLIP = np.diag([1.0, -1.0, -1.0])
"""COLMAP looks along +z with y down, Blender along -z with y up."""


def set_intrinsics(data: bpy.types.Camera, camera: Intrinsics, frame: int | None = None) -> None:
    """Set focal length and principal point of a pinhole, keyed at `frame` if one is given.

    Pixel aspect is a property of the scene, see `set_pixel_aspect`; distortion is the canvas's.
    """
    data.type = "PERSP"
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR
    data.lens = camera.fx * SENSOR / camera.width
    data.shift_x = -(camera.cx - camera.width / 2) / camera.width
    data.shift_y = (camera.cy - camera.height / 2) / camera.width * (camera.fx / camera.fy)
    if frame is not None:
        for path in INTRINSICS:
            data.keyframe_insert(path, frame=frame)


def set_pixel_aspect(render: bpy.types.RenderSettings, camera: Intrinsics) -> None:
    """Set the pixel aspect: the shorter focal length belongs to the longer pixel side."""
    render.pixel_aspect_x = max(camera.fy / camera.fx, 1.0)
    render.pixel_aspect_y = max(camera.fx / camera.fy, 1.0)


def animate(camera: bpy.types.Object, reconstruction: Reconstruction) -> None:
    """Key location, rotation and, where they change, intrinsics on every registered frame."""
    camera.animation_data_clear()
    _clear_intrinsics(camera.data)
    camera.rotation_mode = "QUATERNION"
    images = reconstruction.images
    rotations = _continuous([quaternion_from_matrix(i.rotation.T @ FLIP) for i in images])
    varies = len({image.camera for image in images}) > 1
    for image, rotation in zip(images, rotations, strict=True):
        camera.location = image.centre
        camera.rotation_quaternion = rotation
        camera.keyframe_insert("location", frame=image.frame)
        camera.keyframe_insert("rotation_quaternion", frame=image.frame)
        if varies:
            set_intrinsics(camera.data, reconstruction.intrinsics(image), image.frame)
    if not varies:
        set_intrinsics(camera.data, reconstruction.intrinsics(images[0]))
    for data in (camera, camera.data):
        _make_linear(data)


def _clear_intrinsics(data: bpy.types.Camera) -> None:
    """Remove the keys of the intrinsics; others are the user's, as of a pull of Blender's own focus."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    animation = data.animation_data
    if animation is None or animation.action is None:
        return
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    for curve in [curve for curve in (bag.fcurves if bag else ()) if curve.data_path in INTRINSICS]:
        bag.fcurves.remove(curve)


def _continuous(quaternions: Sequence[Floats]) -> Floats:
    """(k, 4) the same rotations with signs chosen so that interpolation takes the short way."""
    rows = np.array(quaternions)
    turns = np.sign((rows[1:] * rows[:-1]).sum(axis=1))
    rows[1:] *= np.cumprod(np.where(turns == 0, 1, turns))[:, None]
    return rows


def _make_linear(data: bpy.types.ID) -> None:
    """Linear keys, of the type Generated: the dope sheet shows the user's own among them."""
    animation = data.animation_data
    if animation is None or animation.action is None:
        return
    from bpy_extras.anim_utils import action_ensure_channelbag_for_slot

    bag = action_ensure_channelbag_for_slot(animation.action, animation.action_slot)
    generated = bpy.types.Keyframe.bl_rna.properties["type"].enum_items["GENERATED"].value
    ours = (*INTRINSICS, "location", "rotation_quaternion")
    for curve in (curve for curve in bag.fcurves if curve.data_path in ours):
        linear = np.ones(len(curve.keyframe_points), dtype=np.int32)
        curve.keyframe_points.foreach_set("interpolation", linear)
        curve.keyframe_points.foreach_set("type", np.full(len(linear), generated, dtype=np.int32))
        curve.update()
