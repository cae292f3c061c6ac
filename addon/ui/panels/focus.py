"""The Focus panel: the list of focus marks, the distance, tilt, and subjects that move."""

import bpy

from ...scene.lens import blender_focus, depth_of_field, lens
from ..focus import focus_list, subjects
from ..picking import paint_repair
from .panel import ClosedPanel, split


class VIRTUAL_APERTURE_PT_focus(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        by_own = blender_focus.focus_object(settings) is not None
        by_points = bool(lens.focus_of_settings(settings).points)
        marks = layout.column()
        marks.active = not by_own
        if len(settings.marks.items):
            focus_list.draw(marks, context)
        column = layout.column()
        column.active = not by_points and not by_own
        if settings.metres_per_unit > 0:
            # As a length, which focus marks animate.
            column.use_property_decorate = False
            column.prop(settings, "focus_length", text="Distance")
        else:
            column.prop(settings, "focus_distance", text="Distance")
        if sharp := depth_of_field.sharp_words(settings):
            layout.label(text=sharp, icon="CAMERA_DATA")
        if settings.camera is not None and settings.camera.type == "CAMERA":
            layout.prop(settings.camera.data.dof, "focus_object", text="Object")


class VIRTUAL_APERTURE_PT_zone(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "In-Focus Zone"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        column = layout.column(align=True)
        column.prop(settings, "zone_front", text="In Front")
        column.prop(settings, "zone_behind", text="Behind")
        column = layout.column(align=True)
        column.prop(settings, "blur_in_front")
        column.prop(settings, "blur_behind")


class VIRTUAL_APERTURE_PT_repair(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Repair Depth"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        paint_repair.draw(split(self.layout), context)


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
        by_points = bool(lens.focus_of_settings(settings).points)
        column = layout.column(align=True)
        if by_points:
            column.prop(settings, "focus_through_points")
        if not (by_points and settings.focus_through_points):
            column.prop(settings, "focus_tilt")
            column.prop(settings, "focus_swing")
