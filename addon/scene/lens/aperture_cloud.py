"""The virtual cameras shown as points over the aperture, in front of the actual camera."""

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...core.depth.source import SparseDepth
from ...core.frame.clip_context import ClipContext, no_picture
from ...core.frame.forecast import view_offsets
from ..sources.shot import reconstruction_of
from . import depth_of_field
from .lens import focus_frame, frame_options


def update(settings: bpy.types.PropertyGroup) -> None:
    """Move the points to where the settings put the virtual cameras; none while nothing is in focus.

    The camera's own depth of field follows.
    """
    depth_of_field.show_in_camera(settings)
    if settings.aperture is None or settings.points is None:
        return
    mesh = settings.aperture.data
    try:
        positions = _positions(settings)
    except UserError:
        positions = np.zeros((0, 2))
    vertices = np.zeros((len(positions), 3), dtype=np.float32)
    # Image y points down, the Blender camera's up.
    vertices[:, :2] = positions * [1, -1]
    mesh.clear_geometry()
    mesh.vertices.add(len(vertices))
    mesh.attributes["position"].data.foreach_set("vector", vertices.ravel())
    mesh.update()


def _positions(settings: bpy.types.PropertyGroup) -> Floats:
    reconstruction = reconstruction_of(settings)
    image, _ = reconstruction.image_at(focus_frame(settings))
    camera = reconstruction.intrinsics(image)
    clip = ClipContext(reconstruction, no_picture, SparseDepth(reconstruction))
    size = camera.width, camera.height
    return view_offsets(clip, image.frame, frame_options(settings, reconstruction), size)
