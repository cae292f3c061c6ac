"""Any animated camera of a scene as the camera of the clip.

It is Blender's own, or an import of Alembic, FBX, USD, .chan and the exports of matchmoving programs. Poses
and lens are those of Blender's renders, with constraints, parents and drivers; points are found in the clip
(`core/sfm/mapping/known_poses.py`). A frame of the clip has the scene's frame of the same number, or with an
offset.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...core.camera.reconstruction import NO_POINTS, Image, Intrinsics, Reconstruction, nearest_rotation
from ...core.media.clip import Footage
from ...core.readers.matching import SAME_ASPECT, Imported
from ..base.timeline import go_to
from ..solve.camera import FLIP

FORMAT = "Blender camera"
BEYOND = 2000
"""Most frames before and after the clip whose cameras are read to find a fitting offset."""
SHEAR = 1e-3
"""By which the axes of a camera may be off a right angle, for which Blender would draw a skewed picture."""


@dataclass(frozen=True)
class _Sight:
    """A camera at a frame."""

    rotation: Floats
    """(3, 3) world-to-camera, in our axes."""
    centre: Floats
    """(3,)"""
    projection: Floats
    """(4, 4) Blender's, of camera space to the frame from -1 to 1."""


def cameras_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the scene's cameras but the one made for its clip, its active one first."""
    own = scene.virtual_aperture.camera
    found = [thing for thing in scene.objects if thing.type == "CAMERA" and thing != own]
    return sorted(found, key=lambda thing: (thing != scene.camera, thing.name))


def read_scene_camera(
    scene: bpy.types.Scene, camera: bpy.types.Object, footage: Footage, offset: int = 0
) -> Imported:
    """Return the camera at every frame of the clip, in the scene's own unit and world; points are not known.

    The clip's frame f has the scene's frame f + `offset`. Frames around those of the clip are among the
    images, too. UserError for a camera that is no perspective one, that is mirrored or skewed, or that
    Blender does not evaluate.
    """
    if camera.data.type != "PERSP":
        kind = camera.data.type.lower()
        raise UserError(f"the camera {camera.name} is {kind}; only a perspective camera can match a clip")
    shape, notes = _shape(scene, footage)
    sights = _sights(scene, camera, _frames(scene, camera, footage, offset), shape)
    lenses: dict[Intrinsics, int] = {}
    images = []
    for frame, sight in sights.items():
        lens = _intrinsics(camera, sight.projection, footage)
        number = lenses.setdefault(lens, len(lenses))
        translation = -sight.rotation @ sight.centre
        images.append(Image(frame - offset, sight.rotation, translation, camera=number))
    scale = scene.unit_settings.scale_length
    if abs(scale - 1) > 1e-6:
        notes.append(f"lengths are in scene units of {scale:g} m")
    model = Reconstruction(tuple(lenses), tuple(images), NO_POINTS)
    return Imported(model, FORMAT, tuple(notes), placed=True)


def _shape(scene: bpy.types.Scene, footage: Footage) -> tuple[tuple[int, int, float, float], list[str]]:
    """Width, height and pixel sides of the pictures that the camera belongs to, and notes."""
    render = scene.render
    size = render.resolution_x, render.resolution_y
    pixel = render.pixel_aspect_x, render.pixel_aspect_y
    aspect = size[0] * pixel[0] / (size[1] * pixel[1])
    if abs(aspect * footage.height / footage.width - 1) < SAME_ASPECT:
        return (*size, *pixel), []
    note = (
        f"the scene renders pictures of {size[0]}x{size[1]}, the clip has {footage.width}x{footage.height}:"
        " the full clip frame is assumed to cover the camera's sensor"
    )
    return (footage.width, footage.height, 1.0, 1.0), [note]


def _frames(scene: bpy.types.Scene, camera: bpy.types.Object, footage: Footage, offset: int) -> list[int]:
    """The scene's frames at which the camera is looked at: the clip's, and those where it is animated."""
    first, last = footage.frames[0] + offset, footage.frames[-1] + offset
    low, high = min(first, scene.frame_start), max(last, scene.frame_end)
    for data in (camera, camera.data, camera.parent):
        if data is not None and data.animation_data is not None and data.animation_data.action is not None:
            start, end = data.animation_data.action.frame_range
            low, high = min(low, int(start)), max(high, int(end))
    around = range(max(low, first - BEYOND), min(high, last + BEYOND) + 1)
    return sorted({*around, *(frame + offset for frame in footage.frames)})


def _sights(
    scene: bpy.types.Scene, camera: bpy.types.Object, frames: list[int], shape: tuple[int, int, float, float]
) -> dict[int, _Sight]:
    """The camera at frames, relative to the root of the clip's objects, if there is one."""
    layer = scene.view_layers[0]
    shown, subframe = scene.frame_current, scene.frame_subframe
    root = scene.virtual_aperture.root
    width, height, across, down = shape
    found = {}
    try:
        for frame in frames:
            go_to(scene, frame)
            depsgraph = layer.depsgraph
            evaluated = camera.evaluated_get(depsgraph)
            if not evaluated.is_evaluated:
                raise UserError(
                    f"the camera {camera.name} does not move because it is disabled in viewports or its"
                    " collection is excluded; enable it in the Outliner"
                )
            world = np.array(evaluated.matrix_world, dtype=np.float64)
            if root is not None:
                world = np.linalg.inv(np.array(root.matrix_world, dtype=np.float64)) @ world
            projection = camera.calc_matrix_camera(depsgraph, x=width, y=height, scale_x=across, scale_y=down)
            found[frame] = _Sight(
                FLIP @ _rotation(camera, world[:3, :3], frame).T, world[:3, 3],
                np.array(projection, dtype=np.float64),
            )  # fmt: skip
    finally:
        scene.frame_set(shown, subframe=subframe)
    return found


def _rotation(camera: bpy.types.Object, axes: Floats, frame: int) -> Floats:
    """The rotation of a camera's axes (3, 3), whatever it and its parents are scaled by."""
    axes = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-300)
    if not np.abs(axes.T @ axes - np.eye(3)).max() < SHEAR or np.linalg.det(axes) < 0:
        raise UserError(
            f"the camera {camera.name} is mirrored or skewed at frame {frame}; apply its scale, and its"
            " parents' (Object > Apply > Scale)"
        )
    return nearest_rotation(axes)


def _intrinsics(camera: bpy.types.Object, projection: Floats, footage: Footage) -> Intrinsics:
    """The pinhole of a projection matrix, in pixels of the clip."""
    width, height = footage.width, footage.height
    fx, fy = projection[0, 0] * width / 2, projection[1, 1] * height / 2
    if not (fx > 0 and fy > 0):
        raise UserError(f"the camera {camera.name} has no focal length; set one")
    # From the middle, as shares of half the picture, y up.
    cx, cy = (1 - projection[0, 2]) * width / 2, (1 + projection[1, 2]) * height / 2
    return Intrinsics(width, height, float(fx), float(fy), float(cx), float(cy))
