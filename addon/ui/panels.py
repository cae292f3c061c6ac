"""The sidebar panels, in the order of the work: what everybody needs, and the rest in closed sub-panels."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.base.counting import counted
from ..core.lens.meshers import MESHERS
from ..scene import lens, masks
from . import after_solve, choose_clip, depth_ahead, focus, import_solve, inspect, notices, operators
from .text import wrapped

PRIMARY = 1.4
"""Height of the button that a panel is about."""


class _Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Virtual Aperture"


class _Closed(_Panel):
    bl_options = {"DEFAULT_CLOSED"}  # noqa: RUF012


def next_step(context: bpy.types.Context) -> str:
    """What is to be done next, in one line."""
    settings = context.scene.virtual_aperture
    if not settings.footage:
        return "Choose a clip"
    if settings.points is None:
        return "Solve the clip: where the camera was, and how far things are"
    if settings.points.mode == "EDIT":
        return "Select two or more vertices on what is to be sharp, and set the focus"
    if not lens.is_in_focus(settings):
        return "Press Tab over the viewport to select vertices on what is to be sharp"
    return "Ready to render"


class VIRTUAL_APERTURE_PT_clip(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Clip"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        running = operators.running_solve()
        if running is not None:
            layout.progress(factor=running.step.share, text=f"{running.step.text} (ESC cancels)")
        else:
            wrapped(layout, context, next_step(context), icon="INFO")
        layout.operator(
            choose_clip.VIRTUAL_APERTURE_OT_choose_clip.bl_idname,
            text=Path(settings.footage).name or "Choose Clip",
            icon="FILE_MOVIE" if settings.footage else "FILEBROWSER",
        )
        notices.draw_clip(layout, context)
        layout.prop(settings, "lens")
        if settings.lens == "GIVEN":
            layout.prop(settings, "equivalent")
        elif settings.lens == "SENSOR":
            layout.prop(settings, "focal_mm")
            layout.prop(settings, "sensor_mm")
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(operators.VIRTUAL_APERTURE_OT_solve.bl_idname, icon="TRACKER").again = False
        if settings.points is not None or operators.is_kept(settings):
            layout.operator(
                operators.VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve Again", icon="FILE_REFRESH"
            ).again = True
        if settings.points is not None:
            _draw_solve(layout, context)


def _draw_solve(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What the solve found, what would help it, and what it hid."""
    settings = context.scene.virtual_aperture
    box = layout.box()
    if settings.summary:
        wrapped(box, context, settings.summary, icon="CHECKMARK")
        wrapped(box, context, f"Advice: {settings.advice}", icon="INFO")
    else:
        box.label(text="Solved", icon="CHECKMARK")
    depth_ahead.draw(box, settings)
    if (found := depth_ahead.of(settings)) is not None and found.problem:
        wrapped(box, context, f"Depth was not found: {found.problem}", icon="ERROR")
    if names := after_solve.still_hidden(context.scene):
        wrapped(box, context, after_solve.hidden_words(names), icon="HIDE_ON")


class VIRTUAL_APERTURE_PT_import(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Import"
    bl_parent_id = "VIRTUAL_APERTURE_PT_clip"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_import_solve.bl_idname, icon="IMPORT")
        movie_clip = import_solve.VIRTUAL_APERTURE_OT_import_movie_clip.bl_idname
        if import_solve.solved_clips():
            layout.operator_menu_enum(movie_clip, "clip", icon="TRACKING")
        elif bpy.data.movieclips:
            # Disabled, and says why.
            layout.operator(movie_clip, icon="TRACKING")


class VIRTUAL_APERTURE_PT_files(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Files"
    bl_parent_id = "VIRTUAL_APERTURE_PT_clip"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "footage")
        layout.prop(settings, "work_dir")


class VIRTUAL_APERTURE_PT_lens(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Focus and Blur"

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
        column = layout.column(align=True)
        if by_points:
            column.prop(settings, "focus_through_points")
        if not (by_points and settings.focus_through_points):
            column.prop(settings, "focus_tilt")
            column.prop(settings, "focus_swing")
        layout.prop(settings, "blur")
        column = layout.column()
        column.active = not lens.is_keyed(settings, "blur")
        column.prop(settings, "aperture_radius", text="Aperture")
        column = layout.column(align=True)
        column.prop(settings, "highlights")
        row = column.row()
        row.active = settings.highlights > 0
        row.prop(settings, "highlight_threshold")


class VIRTUAL_APERTURE_PT_shape(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Aperture Shape"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

    def draw(self, context: bpy.types.Context) -> None:
        shape = context.scene.virtual_aperture.shape
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.active = not shape.image
        column.prop(shape, "blades")
        row = column.column()
        row.active = shape.blades >= 3
        row.prop(shape, "rotation")
        row.prop(shape, "roundness")
        for name in ("ratio", "obstruction", "apodisation", "spherical_aberration", "vignetting", "image"):
            layout.prop(shape, name)


class VIRTUAL_APERTURE_PT_depth(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Masks and Depth Maps"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "masks")
        layout.prop(settings, "mask")
        if settings.mask is not None and masks.follows_tracks(settings.mask):
            wrapped(layout, context, "Points of the mask that follow tracks stay where they are", icon="INFO")
        layout.prop(settings, "depth_maps")


class VIRTUAL_APERTURE_PT_render(_Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Render"

    def draw(self, context: bpy.types.Context) -> None:
        scene = context.scene
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        column.prop(scene, "frame_start", text="Frame Start")
        column.prop(scene, "frame_end", text="End")
        layout.prop(scene.render, "filepath", text="Output")
        layout.prop(scene.virtual_aperture, "quality")
        wrapped(layout, context, output_words(scene), icon="OUTPUT")
        notices.draw_ignored(layout, context)
        layout.operator(operators.VIRTUAL_APERTURE_OT_render_frame.bl_idname, icon="RENDER_STILL")
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(operators.VIRTUAL_APERTURE_OT_render_clip.bl_idname, icon="RENDER_ANIMATION")


def output_words(scene: bpy.types.Scene) -> str:
    """What Render Clip will do, in one line."""
    render = scene.render
    count = len(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    which = f"Frames {scene.frame_start} to {scene.frame_end}" if count > 1 else f"Frame {scene.frame_start}"
    kind = render.image_settings.bl_rna.properties["file_format"].enum_items[
        render.image_settings.file_format
    ]
    return f"{which}, to {render.filepath or 'the current folder'} as {kind.name}"


class VIRTUAL_APERTURE_PT_method(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Sampling and Method"
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "error")
        layout.prop(settings, "use_auto_views")
        if not settings.use_auto_views:
            layout.prop(settings, "views")
        layout.prop(settings, "method")
        for name in MESHERS[settings.method].settings:
            layout.prop(settings, name)


class VIRTUAL_APERTURE_PT_debug(_Closed, bpy.types.Panel):  # noqa: N801
    bl_label = "Debug"
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"

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
    VIRTUAL_APERTURE_PT_import,
    VIRTUAL_APERTURE_PT_files,
    VIRTUAL_APERTURE_PT_lens,
    VIRTUAL_APERTURE_PT_shape,
    VIRTUAL_APERTURE_PT_depth,
    VIRTUAL_APERTURE_PT_render,
    VIRTUAL_APERTURE_PT_method,
    VIRTUAL_APERTURE_PT_debug,
)
