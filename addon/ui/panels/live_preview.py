"""The live preview: a viewport in Rendered shading that looks through the solved camera."""

from typing import Any

import bpy

from ...render.engine import VirtualApertureEngine
from ...render.viewport.viewport import PREVIEW
from ...scene import parts
from ..base.operators import NO_CAMERA, Acts, has_solve, is_met


class VIRTUAL_APERTURE_OT_preview(Acts, bpy.types.Operator):  # noqa: N801
    """Show the frame with depth of field in this viewport, updated as you change settings"""

    bl_label = "Preview"
    # Not UNDO: it changes the viewport, and nothing of the scene but the engine, which solving has set.

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if is_shown(context):
            # Whatever became of the scene: it can be ended.
            return True
        is_there = parts.is_in(context.scene, context.scene.virtual_aperture.camera)
        has_camera = has_solve(cls, context) and is_met(cls, is_there, NO_CAMERA)
        has_view = viewport_of(context) is not None
        return has_camera and is_met(cls, has_view, "There is no 3D viewport in this window")

    def act(self, context: bpy.types.Context) -> None:
        space = viewport_of(context)
        if is_shown(context):
            space.shading.type = "SOLID"
            return
        # Pictures that failed before are tried again.
        PREVIEW.retry()
        context.scene.render.engine = VirtualApertureEngine.bl_idname
        context.scene.camera = context.scene.virtual_aperture.camera
        space.region_3d.view_perspective = "CAMERA"
        space.shading.type = "RENDERED"


def viewport_of(context: bpy.types.Context) -> Any:
    """Return the 3D viewport of a context, or the first one of its window; None without one."""
    if isinstance(context.space_data, bpy.types.SpaceView3D):
        return context.space_data
    areas = context.screen.areas if context.screen is not None else ()
    return next((area.spaces.active for area in areas if area.type == "VIEW_3D"), None)


def is_shown(context: bpy.types.Context) -> bool:
    """Return whether the viewport of a context shows the frame through the lens."""
    space = viewport_of(context)
    return (
        space is not None
        and space.shading.type == "RENDERED"
        and space.region_3d is not None
        and space.region_3d.view_perspective == "CAMERA"
        and context.scene.render.engine == VirtualApertureEngine.bl_idname
    )
