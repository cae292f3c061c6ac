"""The Footage panel: which clip, and where its files are; on top what is to be done next."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...scene import lens
from .. import choose_clip, import_solve, notices, operators, photos, preferences
from ..text import wrapped
from .panel import PRIMARY, ClosedPanel, Panel, split


def next_step(context: bpy.types.Context) -> str:
    """What is to be done next, in one line."""
    settings = context.scene.virtual_aperture
    if not settings.footage:
        return "Choose a clip"
    if settings.points is None:
        return "Solve the clip to find its camera motion and depth"
    if settings.points.mode == "EDIT":
        return "Select vertices on what should be sharp, ideally four, and set the focus"
    if not lens.is_in_focus(settings):
        return "Press Pick Focus, then click what should be sharp in the viewport"
    return "Ready to render"


class VIRTUAL_APERTURE_PT_footage(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Footage"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return True

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        if operators.running_solve() is None and notices.is_in_order(context.scene):
            wrapped(layout, context, next_step(context), icon="INFO")
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(
            choose_clip.VIRTUAL_APERTURE_OT_choose_clip.bl_idname,
            text=Path(settings.footage).name or "Choose Clip",
            icon="FILE_MOVIE" if settings.footage else "FILEBROWSER",
        )
        if photos.are_photos(settings):
            layout.operator(photos.VIRTUAL_APERTURE_OT_show_photo.bl_idname, icon="IMAGE_DATA")
        notices.draw_scene(layout, context)
        notices.draw_clip(layout, context)
        notices.draw_notes(layout, context)


class VIRTUAL_APERTURE_PT_import(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Import"
    bl_parent_id = "VIRTUAL_APERTURE_PT_footage"

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_import_solve.bl_idname, icon="IMPORT")
        movie_clip = import_solve.VIRTUAL_APERTURE_OT_import_movie_clip.bl_idname
        if import_solve.solved_clips():
            layout.operator_menu_enum(movie_clip, "clip", icon="TRACKING")
        elif bpy.data.movieclips:
            # Disabled, and says why.
            layout.operator(movie_clip, icon="TRACKING")
        layout.operator(import_solve.VIRTUAL_APERTURE_OT_use_scene_camera.bl_idname, icon="CAMERA_DATA")


class VIRTUAL_APERTURE_PT_files(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Files"
    bl_parent_id = "VIRTUAL_APERTURE_PT_footage"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        layout.prop(settings, "footage")
        layout.prop(settings, "work_dir")
        if settings.footage and (size := preferences.shown_size(settings)):
            words = preferences.size_words(size)
            layout.operator(
                preferences.VIRTUAL_APERTURE_OT_delete_depth.bl_idname, text=f"Delete Kept Depth ({words})",
                icon="TRASH",
            )  # fmt: skip


CLASSES = (VIRTUAL_APERTURE_PT_footage, VIRTUAL_APERTURE_PT_import, VIRTUAL_APERTURE_PT_files)
