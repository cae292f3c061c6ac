"""The operators that add the lens as a camera of Cycles, and the grade of a range to the compositor."""

import bpy

from ...scene.lens import lens_camera
from ...scene.passes import add_grade_nodes
from ..base.operators import Edits, has_focus, has_solve, may_change, polls


class VIRTUAL_APERTURE_OT_add_lens_camera(Edits, bpy.types.Operator):  # noqa: N801
    """Add a camera with the clip's path and this lens, through which Cycles renders CG with the same blur;
    again after you change the lens"""

    bl_label = "Add Cycles Camera"

    poll = polls(may_change, has_focus)

    def act(self, context: bpy.types.Context) -> str:
        camera = lens_camera.add_lens_camera(context.scene)
        return f"{camera.name} has the lens in the scene's frames; render with Cycles"


class VIRTUAL_APERTURE_OT_add_grade_nodes(Edits, bpy.types.Operator):  # noqa: N801
    """Add a compositor node with exposure, saturation and haze for the range; your own nodes and links stay
    as they are"""

    poll = polls(may_change, has_solve)

    def act(self, context: bpy.types.Context) -> str:
        node = add_grade_nodes(context.scene, context.view_layer)
        return f"{node.node_tree.name} is in the compositor"
