"""The Focus and Lens panel: what is in focus, and how much blur."""

from __future__ import annotations

import bpy

from ...core.base.counting import counted
from ...scene import blender_focus
from .. import focus, focus_list, lens_presets, pick_focus, subjects
from ..text import wrapped
from .lens import draw_amount
from .panel import PRIMARY, ClosedPanel, Panel, split


class VIRTUAL_APERTURE_PT_focus(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Focus and Lens"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        lens_presets.draw_button(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(pick_focus.VIRTUAL_APERTURE_OT_pick_focus.bl_idname, icon="EYEDROPPER")
        if settings.points is not None and settings.points.mode == "EDIT":
            layout.operator(focus.VIRTUAL_APERTURE_OT_set_focus.bl_idname, icon="PIVOT_MEDIAN")
        by_own = blender_focus.focus_object(settings) is not None
        count = len(settings.focus_points)
        by_points = count > 0 and settings.focus_by == "POINTS"
        marks = layout.column()
        marks.active = not by_own
        if len(settings.marks.items):
            if settings.marks.is_first:
                wrapped(marks, context, "In focus: the nearest large object near the centre", icon="INFO")
            focus_list.draw(marks, context)
        elif count:
            # Points of older files, and of scripts, make no marks.
            _draw_points(marks, settings, by_points)
        column = layout.column()
        column.active = not by_points and not by_own
        column.prop(settings, "focus_distance", text="Distance")
        if settings.camera is not None and settings.camera.type == "CAMERA":
            layout.prop(settings.camera.data.dof, "focus_object", text="Object")
        draw_amount(layout, settings)


def _draw_points(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, by_points: bool) -> None:
    layout.row().prop(settings, "focus_by", expand=True)
    picked = layout.row()
    text = picked.row()
    text.active = by_points
    summary = f"{counted(len(settings.focus_points), 'point')}, picked at frame {settings.focus_frame}"
    text.label(text=summary, icon="PINNED")
    picked.operator(focus.VIRTUAL_APERTURE_OT_clear_focus.bl_idname, text="", icon="X")


class VIRTUAL_APERTURE_PT_subjects(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Subjects"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        subjects.draw(split(self.layout), context)


class VIRTUAL_APERTURE_PT_tilt(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Tilted Focal Plane"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        by_points = len(settings.focus_points) > 0 and settings.focus_by == "POINTS"
        column = layout.column(align=True)
        if by_points:
            column.prop(settings, "focus_through_points")
        if not (by_points and settings.focus_through_points):
            column.prop(settings, "focus_tilt")
            column.prop(settings, "focus_swing")


CLASSES = (VIRTUAL_APERTURE_PT_focus, VIRTUAL_APERTURE_PT_subjects, VIRTUAL_APERTURE_PT_tilt)
