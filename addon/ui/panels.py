"""The sidebar panels, in the order of the work."""

from __future__ import annotations

import bpy

from ..scene import masks
from . import import_solve, inspect, notices, operators


class _Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Virtual Aperture"


class VIRTUAL_APERTURE_PT_clip(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Clip"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "footage")
        notices.draw_clip(layout, context)
        layout.prop(settings, "work_dir")
        layout.prop(settings, "lens")
        if settings.lens == "GIVEN":
            layout.prop(settings, "equivalent")
        elif settings.lens == "SENSOR":
            layout.prop(settings, "focal_mm")
            layout.prop(settings, "sensor_mm")
        row = layout.row()
        row.scale_y = 1.4
        row.operator(operators.VIRTUAL_APERTURE_OT_solve.bl_idname, icon="TRACKER").again = False
        if settings.points is not None or operators.is_kept(settings):
            layout.operator(
                operators.VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve Again", icon="FILE_REFRESH"
            ).again = True
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_import_solve.bl_idname, icon="IMPORT")
        movie_clip = import_solve.VIRTUAL_APERTURE_OT_import_movie_clip.bl_idname
        if import_solve.solved_clips():
            layout.operator_menu_enum(movie_clip, "clip", icon="TRACKING")
        elif bpy.data.movieclips:
            # Disabled, and says why.
            layout.operator(movie_clip, icon="TRACKING")


class VIRTUAL_APERTURE_PT_lens(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Focus and Blur"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.operator(operators.VIRTUAL_APERTURE_OT_set_focus.bl_idname, icon="PIVOT_MEDIAN")
        count = len(settings.focus_points)
        if count:
            layout.label(
                text=f"{count} points in focus, set at frame {settings.focus_frame}", icon="CHECKMARK"
            )
        else:
            layout.prop(settings, "focus_distance")
        layout.prop(settings, "use_radius")
        layout.prop(settings, "aperture_radius" if settings.use_radius else "blur")
        layout.prop(settings, "views")
        layout.prop(settings, "depth_maps")
        layout.prop(settings, "masks")
        layout.prop(settings, "mask")
        if settings.mask is not None and masks.follows_tracks(settings.mask):
            layout.label(text="Points of the mask that follow tracks stay where they are", icon="INFO")


class VIRTUAL_APERTURE_PT_render(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Render"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.prop(settings, "method")
        if settings.method == "layers":
            layout.prop(settings, "borrow")
        elif settings.method == "thesis":
            layout.prop(settings, "seed")
        notices.draw_ignored(layout, context)
        column = layout.column(align=True)
        column.scale_y = 1.4
        column.operator(operators.VIRTUAL_APERTURE_OT_render_frame.bl_idname, icon="RENDER_STILL")
        column.operator(operators.VIRTUAL_APERTURE_OT_render_clip.bl_idname, icon="RENDER_ANIMATION")


class VIRTUAL_APERTURE_PT_debug(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Debug"
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(inspect.VIRTUAL_APERTURE_OT_inspect_frame.bl_idname, icon="VIEWZOOM")
        if images := inspect.shown():
            column = layout.column(align=True)
            column.label(text="In the Image Editor:", icon="IMAGE_DATA")
            for image in images.values():
                column.label(text=image.name)


CLASSES = (
    VIRTUAL_APERTURE_PT_clip,
    VIRTUAL_APERTURE_PT_lens,
    VIRTUAL_APERTURE_PT_render,
    VIRTUAL_APERTURE_PT_debug,
)
