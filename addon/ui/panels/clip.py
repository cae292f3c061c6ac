"""The Clip panel: imports of other programs' solves, and the paths of files."""

from pathlib import Path

import bpy

from ...core.media.sequence import is_pattern
from ..footage import import_solve
from . import notices, preferences
from .panel import ClosedPanel, split


def may_be_photos(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the clip is a folder or a pattern, by its name, without access to files."""
    clip = Path(settings.footage)
    return bool(settings.footage) and (not clip.suffix or is_pattern(clip))


class VIRTUAL_APERTURE_PT_clip(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Clip"

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
    bl_label = "Import"
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
