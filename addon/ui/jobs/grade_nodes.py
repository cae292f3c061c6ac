"""The operator that adds the grade of a range of distances to the compositor."""

from __future__ import annotations

import bpy

from ...scene.grade_nodes import add_grade_nodes
from ..base.operators import Result, has_solve, may_change, polls


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
