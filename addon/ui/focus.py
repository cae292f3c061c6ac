"""Operators of the focus: pick points, and forget them."""

from __future__ import annotations

from dataclasses import replace

import bmesh
import bpy

from ..core.base.counting import counted
from ..core.base.errors import UserError
from ..scene import aperture_cloud, lens
from ..scene.point_cloud import ID_ATTRIBUTE
from ..scene.shot import reconstruction_of
from .operators import Result, has_points, may_change, reported


class VIRTUAL_APERTURE_OT_set_focus(bpy.types.Operator):  # noqa: N801
    """Put the selected vertices of the point cloud in focus: two at least, four are better"""

    bl_idname = "virtual_aperture.set_focus"
    bl_label = "Set Focus from Selected Vertices"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_points(cls, context, "vertices")

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        ids = selected_points(settings.points)
        if len(ids) < 2:
            are = "vertex is" if len(ids) == 1 else "vertices are"
            raise UserError(f"{len(ids)} {are} selected; select at least two on what is to be in focus")
        reconstruction = reconstruction_of(settings)
        if len(ids) == len(reconstruction.points):
            raise UserError(
                f"all {len(ids)} vertices are selected; press Alt A to select none, then select some on what"
                " is to be in focus"
            )
        focus = replace(lens.focus_of(settings), points=tuple(ids), distance=None)
        image, _ = reconstruction.image_at(context.scene.frame_current)
        frame = image.frame
        # Whether there is a plane through them.
        focus.lens(reconstruction, frame, reconstruction.intrinsics(image).without_distortion(), 1.0)
        # In Edit Mode only the mesh can be undone, and the points' colours are hidden.
        bpy.ops.object.mode_set(mode="OBJECT")
        lens.set_focus(settings, focus, frame)
        said = f"{counted(len(ids), 'point')} are in focus"
        if lens.has_keys(settings, "focus_distance"):
            # In a pull the next pick is the next key: the points alone would hide it.
            lens.key_distance(settings)
            said = f"the focus distance is keyed at frame {context.scene.frame_current}"
        aperture_cloud.update(settings)
        self.report({"INFO"}, said[0].upper() + said[1:])
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_clear_focus(bpy.types.Operator):  # noqa: N801
    """Forget the picked points: the focus stays where it is, at the focus distance"""

    bl_idname = "virtual_aperture.clear_focus"
    bl_label = "Clear Focus"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not may_change(cls, context):
            return False
        if len(context.scene.virtual_aperture.focus_points):
            return True
        cls.poll_message_set("No points are picked")
        return False

    def execute(self, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        lens.clear_points(settings)
        aperture_cloud.update(settings)
        return {"FINISHED"}


def selected_points(points: bpy.types.Object) -> list[int]:
    """IDs of the vertices that are selected in Edit Mode."""
    vertices = bmesh.from_edit_mesh(points.data).verts
    # Attribute arrays are empty while a mesh is edited: the IDs are in the edit mesh's own layer.
    layer = vertices.layers.int[ID_ATTRIBUTE]
    return [vertex[layer] for vertex in vertices if vertex.select]


CLASSES = (VIRTUAL_APERTURE_OT_set_focus, VIRTUAL_APERTURE_OT_clear_focus)
