"""Everything that is registered with Blender, in one ordered list."""

from __future__ import annotations

import bpy

from ..render import background, cg_preview, cg_process, engine, frame_notes, frames_ahead, overlay, viewport
from ..scene import clip, exr, file_handlers, focus_sync, main_thread, passes, paths, properties, shot
from ..scene import preferences as user_preferences
from . import (
    bokeh,
    choose_clip,
    closing,
    depth_ahead,
    engine_panels,
    export,
    file_import,
    find_clip,
    first_person,
    focus,
    focus_list,
    focus_strip,
    import_solve,
    lens_presets,
    movie,
    panels,
    photos,
    pick_focus,
    pick_subject,
    points_overlay,
    preferences,
    preview,
    render_clip,
    report_list,
    restore,
    set_scale,
    solve,
    solve_view,
    solving,
    subjects,
    thumbnails,
    wipe,
)

CLASSES = (
    *engine.CLASSES,
    *preferences.CLASSES,
    *choose_clip.CLASSES,
    *depth_ahead.CLASSES,
    *solve.CLASSES,
    *movie.CLASSES,
    *render_clip.CLASSES,
    *export.CLASSES,
    *closing.CLASSES,
    *find_clip.CLASSES,
    *restore.CLASSES,
    *photos.CLASSES,
    *focus.CLASSES,
    *focus_list.CLASSES,
    *focus_strip.CLASSES,
    *pick_focus.CLASSES,
    *pick_subject.CLASSES,
    *subjects.CLASSES,
    *import_solve.CLASSES,
    *file_import.CLASSES,
    *lens_presets.CLASSES,
    *set_scale.CLASSES,
    *report_list.CLASSES,
    *preview.CLASSES,
    *wipe.CLASSES,
    *panels.CLASSES,
)


def register() -> None:
    """Register properties, engine, operators and panels."""
    properties.register()
    passes.register()
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
    closing.register()
    depth_ahead.register()
    first_person.register()
    main_thread.start()


def unregister() -> None:
    """Undo `register` in reverse order, end what is under way, and close the open clip."""
    solving.end_solve()
    closing.unregister()
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
    passes.unregister()
    properties.unregister()
