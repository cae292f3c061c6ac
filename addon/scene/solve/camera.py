"""Cameras of the reconstruction as Blender cameras."""

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.camera.reconstruction import Intrinsics, Reconstruction, quaternion_from_matrix

SENSOR = 36.0
"""Millimetres of the horizontal sensor, Blender's own default."""
INTRINSICS = ("lens", "shift_x", "shift_y")
"""Properties of a camera that are keyed where the intrinsics change."""
POSE = ("location", "rotation_quaternion")
"""Properties of the camera object that are keyed."""
UNMOVED = {
    "rotation_mode": "QUATERNION", "scale": (1.0, 1.0, 1.0), "parent_type": "OBJECT",
    "matrix_parent_inverse": np.eye(4), "delta_location": (0.0, 0.0, 0.0),
    "delta_rotation_quaternion": (1.0, 0.0, 0.0, 0.0), "delta_rotation_euler": (0.0, 0.0, 0.0),
    "delta_scale": (1.0, 1.0, 1.0),
}  # fmt: skip
"""Properties of the camera object that are as in a new one, but for the mode of its rotation."""
VIEW = ("type", "sensor_fit", "sensor_width", *INTRINSICS)
"""Properties of a camera that the intrinsics determine."""
FLIP = np.diag([1.0, -1.0, -1.0])
"""COLMAP looks along +z with y down, Blender along -z with y up."""


def set_intrinsics(data: bpy.types.Camera, camera: Intrinsics, frame: int | None = None) -> None:
    """Set focal length and principal point of a pinhole, keyed at `frame` if one is given.

    Pixel aspect is a property of the scene, see `set_pixel_aspect`; distortion is the canvas's.
    """
    for path, value in view_of(camera).items():
        setattr(data, path, value)
    if frame is not None:
        for path in INTRINSICS:
            data.keyframe_insert(path, frame=frame)


def view_of(camera: Intrinsics) -> dict[str, Any]:
    """Return the properties of a Blender camera that has a pinhole."""
    return {
        "type": "PERSP", "sensor_fit": "HORIZONTAL", "sensor_width": SENSOR,
        "lens": camera.fx * SENSOR / camera.width,
        "shift_x": -(camera.cx - camera.width / 2) / camera.width,
        "shift_y": (camera.cy - camera.height / 2) / camera.width * (camera.fx / camera.fy),
    }  # fmt: skip


def pixel_aspect(camera: Intrinsics) -> dict[str, float]:
    """Return the pixel aspect of a scene: the shorter focal length belongs to the longer pixel side."""
    across, down = camera.fy / camera.fx, camera.fx / camera.fy
    return {"pixel_aspect_x": max(across, 1.0), "pixel_aspect_y": max(down, 1.0)}


def set_pixel_aspect(render: bpy.types.RenderSettings, camera: Intrinsics) -> None:
    """Set the pixel aspect of a scene for a pinhole."""
    for path, value in pixel_aspect(camera).items():
        setattr(render, path, value)


def rotations_of(reconstruction: Reconstruction) -> Floats:
    """Return the camera's rotation at each registered frame, a quaternion (k, 4) as it is keyed."""
    images = reconstruction.images
    return _continuous([quaternion_from_matrix(i.rotation.T @ FLIP) for i in images])


def animate(camera: bpy.types.Object, reconstruction: Reconstruction) -> None:
    """Key location, rotation and, where they change, intrinsics on every registered frame.

    Whatever else moves the camera or changes its view is removed.
    """
    camera.constraints.clear()
    for path, value in UNMOVED.items():
        setattr(camera, path, value)
    images, rotations = reconstruction.images, rotations_of(reconstruction)
    varies = len({image.camera for image in images}) > 1
    _clear(camera, POSE, images[0].frame)
    _clear(camera.data, VIEW, images[0].frame if varies else None)
    for image, rotation in zip(images, rotations, strict=True):
        camera.location = image.centre
        camera.rotation_quaternion = rotation
        for path in POSE:
            camera.keyframe_insert(path, frame=image.frame)
        if varies:
            set_intrinsics(camera.data, reconstruction.intrinsics(image), image.frame)
    if not varies:
        set_intrinsics(camera.data, reconstruction.intrinsics(images[0]))
    for data in (camera, camera.data):
        _make_linear(data)


def _clear(data: bpy.types.ID, paths: Sequence[str], frame: int | None) -> None:
    """Remove what animates properties; the rest is the user's, as of a pull of Blender's own focus."""
    if frame is not None:
        # Blender's first key can take up an Action again, with old curves.
        data.keyframe_insert(paths[-1], frame=frame)
    if data.animation_data is None:
        return
    for track in list(data.animation_data.nla_tracks):
        data.animation_data.nla_tracks.remove(track)
    for curves in (data.animation_data.drivers, curves_of(data)):
        for curve in [curve for curve in curves if curve.data_path in (*paths, *UNMOVED)]:
            if curve.group is not None:
                curve.group.mute = False
            curves.remove(curve)


def curves_of(data: bpy.types.ID) -> Any:
    """Return the F-curves of a datablock; none without an action."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    animation = data.animation_data
    if animation is None or animation.action is None:
        return ()
    bag = action_get_channelbag_for_slot(animation.action, animation.action_slot)
    return bag.fcurves if bag else ()


def _continuous(quaternions: Sequence[Floats]) -> Floats:
    """(k, 4) the same rotations with signs chosen so that interpolation takes the short way."""
    rows = np.array(quaternions)
    turns = np.sign((rows[1:] * rows[:-1]).sum(axis=1))
    rows[1:] *= np.cumprod(np.where(turns == 0, 1, turns))[:, None]
    return rows


def _make_linear(data: bpy.types.ID) -> None:
    """Linear keys, of the type Generated: the dope sheet shows the user's own among them."""
    generated = bpy.types.Keyframe.bl_rna.properties["type"].enum_items["GENERATED"].value
    for curve in (curve for curve in curves_of(data) if curve.data_path in (*INTRINSICS, *POSE)):
        linear = np.ones(len(curve.keyframe_points), dtype=np.int32)
        curve.keyframe_points.foreach_set("interpolation", linear)
        curve.keyframe_points.foreach_set("type", np.full(len(linear), generated, dtype=np.int32))
        curve.update()
