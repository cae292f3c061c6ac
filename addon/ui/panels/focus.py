"""The Focus and Lens panel: what is in focus, and how much blur."""

from __future__ import annotations

import bpy

from ...core.base.counting import counted
from .. import focus, lens_presets
from .lens import draw_amount
from .panel import PRIMARY, ClosedPanel, Panel


class VIRTUAL_APERTURE_PT_focus(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Focus and Lens"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        lens_presets.draw_button(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(focus.VIRTUAL_APERTURE_OT_set_focus.bl_idname, icon="PIVOT_MEDIAN")
        count = len(settings.focus_points)
        by_points = count > 0 and settings.focus_by == "POINTS"
        if count:
            layout.row().prop(settings, "focus_by", expand=True)
            picked = layout.row()
            text = picked.row()
            text.active = by_points
            text.label(
                text=f"{counted(count, 'point')}, picked at frame {settings.focus_frame}", icon="PINNED"
            )
            picked.operator(focus.VIRTUAL_APERTURE_OT_clear_focus.bl_idname, text="", icon="X")
        column = layout.column()
        column.active = not by_points
        column.prop(settings, "focus_distance", text="Distance")
        draw_amount(layout, settings)


class VIRTUAL_APERTURE_PT_tilt(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Tilted Focal Plane"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        by_points = len(settings.focus_points) > 0 and settings.focus_by == "POINTS"
        column = layout.column(align=True)
        if by_points:
            column.prop(settings, "focus_through_points")
        if not (by_points and settings.focus_through_points):
            column.prop(settings, "focus_tilt")
            column.prop(settings, "focus_swing")


CLASSES = (VIRTUAL_APERTURE_PT_focus, VIRTUAL_APERTURE_PT_tilt)
