"""Everything that is registered with Blender, in one ordered list."""

from __future__ import annotations

import bpy

from ..render import background, engine
from ..scene import clip, exr, focus_sync, main_thread, paths, properties, shot
from . import (
    choose_clip,
    depth_ahead,
    engine_panels,
    find_clip,
    focus,
    focus_list,
    import_solve,
    inspect,
    operators,
    panels,
    pick_focus,
    points_overlay,
    thumbnails,
)

CLASSES = (
    *engine.CLASSES,
    *choose_clip.CLASSES,
    *depth_ahead.CLASSES,
    *operators.CLASSES,
    *find_clip.CLASSES,
    *focus.CLASSES,
    *focus_list.CLASSES,
    *pick_focus.CLASSES,
    *import_solve.CLASSES,
    *inspect.CLASSES,
    *panels.CLASSES,
)


def register() -> None:
    """Register properties, engine, operators and panels."""
    properties.register()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    engine_panels.register()
    paths.register()
    exr.register()
    focus_sync.register()
    points_overlay.register()
    thumbnails.register()
    background.register()
    depth_ahead.register()
    main_thread.start()


def unregister() -> None:
    """Undo `register` in reverse order, and close the open clip."""
    main_thread.stop()
    depth_ahead.unregister()
    focus_sync.unregister()
    exr.unregister()
    paths.unregister()
    background.unregister()
    engine_panels.unregister()
    clip.forget()
    thumbnails.unregister()
    points_overlay.unregister()
    shot.forget()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    properties.unregister()
