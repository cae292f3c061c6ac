"""Everything that is registered with Blender, in one ordered list."""

import bpy

from ..core.base.job import end_all
from ..render import engine
from ..render.cg import cg_preview, cg_process
from ..render.output import background
from ..render.processes import frames_ahead
from ..render.viewport import overlay, viewport
from ..render.views import frame_notes
from ..scene import cg_objects, file_handlers, passes, properties
from ..scene.base import exr, paths
from ..scene.base import preferences as user_preferences
from ..scene.focus import focus_sync
from ..scene.gpu import main_thread
from ..scene.sources import clip, shot
from . import panels
from .base import solving
from .base.operators import classes_of
from .focus import (
    bokeh,
    focus_list,
    focus_strip,
    lens_amount,
    lens_presets,
    repair_list,
    subjects,
    thumbnails,
)
from .footage import choose_clip, file_import, find_clip, import_solve, photos, restore, solve, solve_view
from .jobs import add, depth_ahead, export, first_person, movie, quit_question, render_clip, report_list
from .panels import engine_panels, live_preview, preferences, wipe
from .picking import paint_repair, pick_focus, pick_subject, pick_vertices, points_overlay, set_scale

LEFT = 2.0
"""Seconds for our processes to end when the extension is disabled; then they are killed."""
CLASSES = (
    engine.VirtualApertureEngine,
    *classes_of(
        preferences, choose_clip, depth_ahead, solve, movie, render_clip, export, add, quit_question,
        find_clip, restore, photos, pick_vertices, focus_list, focus_strip, pick_focus, pick_subject,
        paint_repair, subjects, repair_list, import_solve, file_import, lens_presets, lens_amount, set_scale,
        report_list, live_preview, wipe,
    ),
    *panels.CLASSES,
)  # fmt: skip
FIRST = engine_panels, file_import, lens_presets, paths, file_handlers, exr, focus_sync, thumbnails, bokeh
# `cg_preview` follows `viewport`, which ends the preview when another file is opened, and may wait for it.
THEN = background, frame_notes, frames_ahead, cg_process, viewport, cg_preview
LAST = quit_question, depth_ahead, first_person


def register() -> None:
    """Register properties, engine, operators and panels."""
    properties.register()
    passes.register()
    cg_objects.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    user_preferences.apply()
    for module in FIRST:
        module.register()
    overlay.show(focus_strip.draw)
    for module in THEN:
        module.register()
    # After what takes overlays away from the preview's picture: the points are drawn over that.
    overlay.show(points_overlay.draw, "POST_VIEW")
    overlay.show(solve_view.draw)
    for module in LAST:
        module.register()
    main_thread.start()


def unregister() -> None:
    """Undo `register` in reverse order, end what is under way, and close the open clip."""
    solving.end_solve()
    for module in (movie, export, *reversed(LAST)):
        module.unregister()
    for draw in (solve_view.draw, focus_strip.draw, points_overlay.draw):
        overlay.hide(draw)
    for module in reversed(THEN):
        module.unregister()
    main_thread.stop()
    # The timer that looked after them is gone.
    end_all(LEFT)
    for module in reversed(FIRST):
        module.unregister()
    clip.forget()
    shot.forget()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    cg_objects.unregister()
    passes.unregister()
    properties.unregister()
