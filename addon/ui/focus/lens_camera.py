"""The operator that adds the lens to the scene as a camera of Cycles."""

from __future__ import annotations

import bpy

from ...scene.lens import lens_camera
from ..base.operators import Result, has_focus, may_change, polls, reported


class VIRTUAL_APERTURE_OT_add_lens_camera(bpy.types.Operator):  # noqa: N801
    """Add a camera with the clip's path and this lens, through which Cycles renders CG with the same blur;
    again after you change the lens"""

    bl_idname = "virtual_aperture.add_lens_camera"
    bl_label = "Add Cycles Camera"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    poll = polls(may_change, has_focus)

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        camera = lens_camera.add_lens_camera(context.scene)
        self.report({"INFO"}, f"{camera.name} has the lens in the scene's frames; render with Cycles")
        return {"FINISHED"}
