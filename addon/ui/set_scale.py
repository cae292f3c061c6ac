"""Telling how large the scene is: the distance of two feature points in metres."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.base.errors import UserError
from ..scene.shot import reconstruction_of
from .focus import selected_points
from .operators import Result, has_points, reported


class VIRTUAL_APERTURE_OT_set_scale(bpy.types.Operator):  # noqa: N801
    """Set the real distance between two selected vertices of the point cloud, to get f-stops and lengths in
    metres"""

    bl_idname = "virtual_aperture.set_scale"
    bl_label = "Set Scale from Two Vertices"
    bl_options = {"UNDO"}  # noqa: RUF012

    metres: bpy.props.FloatProperty(
        name="Distance in Metres",
        description="Distance between the two vertices, as measured on location",
        default=1.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=100.0,
        precision=3,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_points(cls, context, "two vertices")

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        settings = context.scene.virtual_aperture
        try:
            length = distance_of_selected(settings)
        except UserError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if settings.metres_per_unit > 0:
            self.metres = length * settings.metres_per_unit
        answer: Result = context.window_manager.invoke_props_dialog(self, confirm_text="Set Scale")
        return answer

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        length = distance_of_selected(settings)
        # In Edit Mode only the mesh can be undone.
        bpy.ops.object.mode_set(mode="OBJECT")
        settings.metres_per_unit = self.metres / length
        self.report({"INFO"}, f"One scene unit is {settings.metres_per_unit:.4g} m")
        return {"FINISHED"}


def distance_of_selected(settings: bpy.types.PropertyGroup) -> float:
    """Between the two selected points, in scene units; UserError where there are not two, or in one place."""
    ids = selected_points(settings.points)
    if len(ids) != 2:
        are = "vertex is" if len(ids) == 1 else "vertices are"
        raise UserError(f"{len(ids)} {are} selected; select two a known distance apart")
    one, other = reconstruction_of(settings).points.xyz[ids]
    length = float(np.linalg.norm(one - other))
    if not length > 0:
        raise UserError("the two selected vertices are in the same place; select two others")
    return length


CLASSES = (VIRTUAL_APERTURE_OT_set_scale,)
