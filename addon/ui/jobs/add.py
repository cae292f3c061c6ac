"""The operators that add the lens as a camera of Cycles, and the grade of a range to the compositor."""

import bpy

from ...scene.grade_nodes import add_grade_nodes
from ...scene.lens import lens_camera
from ..base.operators import Result, has_focus, has_solve, may_change, polls, reported


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


class VIRTUAL_APERTURE_OT_add_grade_nodes(bpy.types.Operator):  # noqa: N801
    """Add a compositor node with exposure, saturation and haze for the range; your own nodes and links stay
    as they are"""

    bl_idname = "virtual_aperture.add_grade_nodes"
    bl_label = "Add Grade Nodes"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    poll = polls(may_change, has_solve)

    def execute(self, context: bpy.types.Context) -> Result:
        node = add_grade_nodes(context.scene, context.view_layer)
        self.report({"INFO"}, f"{node.node_tree.name} is in the compositor")
        return {"FINISHED"}
