"""Everything that is registered with Blender, in one ordered list.

`background` is imported for its handlers (`scene.base.events`).
"""

import bpy

from ..core.base.worker import end_all
from ..core.media import picture_file
from ..render import engine
from ..render.cg import cg_process
from ..render.output import background
from ..render.processes import frames_ahead
from ..render.viewport import overlay, viewport
from ..render.views import frame_notes
from ..scene import file_handlers, properties
from ..scene.base import events, exr
from ..scene.base import preferences as user_preferences
from ..scene.gpu import main_thread
from ..scene.sources import clip, shot
from . import panels
from .base.operators import classes_of
from .base.solving import end_solve
from .focus import bokeh, focus_list, focus_strip, lens_amount, lens_presets, subjects, thumbnails
from .footage import file_import, import_solve, photos, restore, solve, solve_view
from .jobs import add, depth_ahead, export, first_person, movie, quit_question, render_clip, report_list
from .panels import engine_panels, live_preview, preferences
from .picking import paint_repair, pick_focus, pick_subject, pick_vertices, points_overlay, set_scale

LEFT = 2.0
"""Seconds for our processes to end when the extension is disabled; then they are killed."""
CLASSES = (
    engine.VirtualApertureEngine,
    *classes_of(
        preferences, depth_ahead, solve, movie, render_clip, export, add, quit_question,
        restore, photos, pick_vertices, focus_list, focus_strip, pick_focus, pick_subject,
        paint_repair, subjects, import_solve, file_import, lens_presets, lens_amount, set_scale,
        report_list, live_preview,
    ),
    *panels.CLASSES,
)  # fmt: skip
PARTS = engine_panels, quit_question
"""Modules that add something to Blender besides classes."""
MENUS = (
    (bpy.types.TOPBAR_MT_file_import, file_import.draw_menu),
    (bpy.types.VIEW3D_HT_header, live_preview.draw_header),
    (bpy.types.STATUSBAR_HT_header, quit_question.draw), (bpy.types.TOPBAR_MT_file, quit_question.draw),
)  # fmt: skip
"""Menus and headers of Blender's, with the functions that draw in them, too."""
# `POST_VIEW` follows what takes overlays away from the preview's picture: the points are drawn over that.
OVERLAYS = (
    (focus_strip.draw, "POST_PIXEL"), (viewport.clear_overlays, "POST_VIEW"),
    (viewport.draw_words, "POST_PIXEL"), (points_overlay.draw, "POST_VIEW"),
    (solve_view.draw, "POST_PIXEL"),
)  # fmt: skip
ENDS = (
    end_solve, movie.MovieJob.stop, export.ExportJob.stop, first_person.stop, depth_ahead.stop, viewport.stop,
    cg_process.end, frames_ahead.forget, frame_notes.forget, thumbnails.forget, bokeh.ICONS.forget,
)  # fmt: skip
"""Functions that end what is under way."""


def register() -> None:
    """Register properties, engine, operators and panels."""
    properties.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    user_preferences.apply()
    file_handlers.look()
    for module in PARTS:
        module.register()
    picture_file.exr_decoder = exr.read
    bpy.utils.register_preset_path(str(lens_presets.ROOT))
    for menu, drawn in MENUS:
        menu.append(drawn)
    for draw, when in OVERLAYS:
        overlay.show(draw, when)
    events.register()
    main_thread.start()


def unregister() -> None:
    """Undo `register` in reverse order, end what is under way, and close the open clip."""
    for end in ENDS:
        end()
    overlay.hide_all()
    events.unregister()
    main_thread.stop()
    # The timer that looked after them is gone.
    end_all(LEFT)
    for menu, drawn in MENUS:
        menu.remove(drawn)
    bpy.utils.unregister_preset_path(str(lens_presets.ROOT))
    picture_file.exr_decoder = None
    for module in reversed(PARTS):
        module.unregister()
    clip.forget()
    shot.forget()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
