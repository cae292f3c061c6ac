"""The panels Clip and Solve: files, imports, prior knowledge of the lens, the report on the solve."""

import bpy

from ...scene.sources import masks
from ..base import operators
from ..base.text import wrapped
from ..footage import after_solve, import_solve, photos, solve
from ..jobs import depth_ahead
from . import notices, preferences
from .panel import ClosedPanel, split


class VIRTUAL_APERTURE_PT_clip(ClosedPanel, bpy.types.Panel):  # noqa: N801
    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        layout.prop(settings, "footage")
        layout.prop(settings, "work_dir")
        layout.prop(settings, "colour_space")
        if settings.footage and (size := preferences.shown_size(settings)):
            words = preferences.size_words(size)
            layout.operator(
                preferences.VIRTUAL_APERTURE_OT_delete_depth.bl_idname, text=f"Delete Kept Depth ({words})",
                icon="TRASH",
            )  # fmt: skip
        notices.draw_notes(layout, context)


class VIRTUAL_APERTURE_PT_import(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_parent_id = "VIRTUAL_APERTURE_PT_clip"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_import_solve.bl_idname, icon="IMPORT")
        movie_clip = import_solve.VIRTUAL_APERTURE_OT_import_movie_clip.bl_idname
        if import_solve.solved_clips():
            layout.operator_menu_enum(movie_clip, "clip", icon="TRACKING")
        elif bpy.data.movieclips:
            # Disabled, with the reason.
            layout.operator(movie_clip, icon="TRACKING")
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_use_scene_camera.bl_idname, icon="CAMERA_DATA")


class VIRTUAL_APERTURE_PT_solve(ClosedPanel, bpy.types.Panel):  # noqa: N801
    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        if photos.may_be_photos(settings):
            layout.prop(settings, "stills")
        layout.prop(settings, "lens")
        if settings.lens == "GIVEN":
            layout.prop(settings, "equivalent")
        elif settings.lens == "SENSOR":
            layout.prop(settings, "focal_mm")
            layout.prop(settings, "sensor_mm")
        layout.prop(settings, "pixel_aspect")
        if settings.points is not None or solve.is_kept(settings):
            layout.operator(
                solve.VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve Again", icon="FILE_REFRESH"
            ).again = True
        if settings.points is not None:
            _draw_solve(layout, context)


def _draw_solve(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the report on the solve, advice, and hidden objects."""
    settings = context.scene.virtual_aperture
    box = layout.box()
    if settings.summary:
        wrapped(box, context, settings.summary, icon="CHECKMARK")
        if advice := settings.advice:
            wrapped(box, context, operators.sentence(advice), icon="INFO")
    else:
        box.label(text="Solved", icon="CHECKMARK")
    depth_ahead.draw(box, settings)
    if things := after_solve.still_hidden(context.scene):
        wrapped(box, context, after_solve.hidden_words(things), icon="HIDE_ON")


class VIRTUAL_APERTURE_PT_depth(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Masks and Depth Maps"
    bl_parent_id = "VIRTUAL_APERTURE_PT_solve"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        layout.prop(settings, "masks")
        layout.prop(settings, "mask")
        if settings.mask is not None and masks.follows_tracks(settings.mask):
            wrapped(layout, context, "Mask points that follow tracks stay in place", icon="INFO")
        layout.prop(settings, "segmenter")
        layout.prop(settings, "depth_maps")
        layout.prop(settings, "fixed")
