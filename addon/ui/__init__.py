"""Everything that is registered with Blender, in one ordered list."""

from __future__ import annotations

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
from .focus import (
    bokeh,
    focus_list,
    focus_strip,
    lens_camera,
    lens_presets,
    repair_list,
    subjects,
    thumbnails,
)
from .footage import choose_clip, file_import, find_clip, import_solve, photos, restore, solve, solve_view
from .jobs import (
    depth_ahead,
    export,
    first_person,
    grade_nodes,
    movie,
    quit_question,
    render_clip,
    report_list,
)
from .panels import engine_panels, live_preview, preferences, wipe
from .picking import paint_repair, pick_focus, pick_subject, pick_vertices, points_overlay, set_scale

LEFT = 2.0
"""Seconds for our processes to end when the extension is disabled; then they are killed."""

CLASSES = (
    *engine.CLASSES,
    *preferences.CLASSES,
    *choose_clip.CLASSES,
    *depth_ahead.CLASSES,
    *solve.CLASSES,
    *movie.CLASSES,
    *render_clip.CLASSES,
    *export.CLASSES,
    *grade_nodes.CLASSES,
    *quit_question.CLASSES,
    *find_clip.CLASSES,
    *restore.CLASSES,
    *photos.CLASSES,
    *pick_vertices.CLASSES,
    *focus_list.CLASSES,
    *focus_strip.CLASSES,
    *pick_focus.CLASSES,
    *pick_subject.CLASSES,
    *paint_repair.CLASSES,
    *subjects.CLASSES,
    *repair_list.CLASSES,
    *import_solve.CLASSES,
    *file_import.CLASSES,
    *lens_presets.CLASSES,
    *lens_camera.CLASSES,
    *set_scale.CLASSES,
    *report_list.CLASSES,
    *live_preview.CLASSES,
    *wipe.CLASSES,
    *panels.CLASSES,
)


def register() -> None:
    """Register properties, engine, operators and panels."""
    properties.register()
    passes.register()
    cg_objects.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    user_preferences.apply()
    engine_panels.register()
    file_import.register()
    lens_presets.register()
    paths.register()
    file_handlers.register()
    exr.register()
    focus_sync.register()
    thumbnails.register()
    bokeh.register()
    overlay.show(focus_strip.draw)
    background.register()
    frame_notes.register()
    frames_ahead.register()
    cg_process.register()
    viewport.register()
    # After what ends the preview where another file is opened, which may wait for the process.
    cg_preview.register()
    # After what takes overlays away from the preview's picture: the points are drawn over that.
    overlay.show(points_overlay.draw, "POST_VIEW")
    overlay.show(solve_view.draw)
    quit_question.register()
    depth_ahead.register()
    first_person.register()
    main_thread.start()


def unregister() -> None:
    """Undo `register` in reverse order, end what is under way, and close the open clip."""
    solving.end_solve()
    quit_question.unregister()
    movie.unregister()
    export.unregister()
    for draw in (solve_view.draw, focus_strip.draw, points_overlay.draw):
        overlay.hide(draw)
    viewport.unregister()
    cg_preview.unregister()
    cg_process.unregister()
    frames_ahead.unregister()
    frame_notes.unregister()
    main_thread.stop()
    first_person.unregister()
    depth_ahead.unregister()
    # The timer that looked after them is gone.
    end_all(LEFT)
    focus_sync.unregister()
    exr.unregister()
    file_handlers.unregister()
    paths.unregister()
    background.unregister()
    lens_presets.unregister()
    file_import.unregister()
    engine_panels.unregister()
    clip.forget()
    thumbnails.unregister()
    bokeh.unregister()
    shot.forget()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    cg_objects.unregister()
    passes.unregister()
    properties.unregister()
