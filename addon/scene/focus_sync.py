"""Takes in what the user does to the focus elsewhere: in the dope sheet, and in the camera's own properties.

Handlers look after each change of the data, on the main thread and never while Blender renders or while keys
are being dragged. What they change is part of the next undo step; after an undo they look again.
"""

from __future__ import annotations

import contextlib
import threading

import bpy
from bpy.app.handlers import persistent

from . import blender_focus, focus_curve, focus_marks, lens

AGAIN = 0.1
"""Seconds until the next look while keys are being dragged."""
DRAGGING = ("TRANSFORM_OT_", "ACTION_OT_", "GRAPH_OT_")
"""What the names of operators that drag keys begin with."""


def take_in(scene: bpy.types.Scene) -> None:
    """Bring marks, keys, and the camera's own focus distance into agreement: what was edited last counts."""
    settings = scene.virtual_aperture
    if settings.points is None or lens.is_writing():
        return
    _take_in_keys(settings)
    if settings.camera is None:
        return
    edited = blender_focus.edited(settings)
    if edited is not None:
        settings.marks.shown = edited
        settings.focus_distance = edited
        _take_in_keys(settings)
    blender_focus.show(settings, settings.focus_distance)
    if not settings.use_radius and blender_focus.distance(settings) is not None:
        with lens.writing():
            lens.on_focus(settings)


def _take_in_keys(settings: bpy.types.PropertyGroup) -> None:
    group = settings.marks
    if not len(group.items) or group.left:
        return
    if not group.written:
        _take_in_distance(settings)
        return
    if focus_curve.is_as_written(settings):
        return
    edit = focus_curve.edit_of(settings)
    if edit is None:
        group.left = True
        return
    _apply(settings, edit)
    focus_curve.accept(settings)
    focus_marks.write(settings)


def _take_in_distance(settings: bpy.types.PropertyGroup) -> None:
    """A distance that was set by hand takes the place of the only mark."""
    (mark, *others) = settings.marks.items
    is_other = settings.focus_distance != mark.distance and settings.focus_distance > 0
    if others or settings.focus_by != "DISTANCE" or not is_other or lens.has_keys(settings, "focus_distance"):
        return
    focus_marks.set_distance(mark, settings.focus_distance)
    settings.marks.is_first = False


def _apply(settings: bpy.types.PropertyGroup, edit: focus_curve.Edit) -> None:
    """Do to the marks what was done to their keys."""
    with lens.writing():
        items = settings.marks.items
        for number in reversed(range(len(items))):
            mark = items[number]
            if mark.frame in edit.removed:
                items.remove(number)
            elif mark.frame in edit.moved:
                mark.frame, distance = edit.moved[mark.frame]
                if distance is not None:
                    focus_marks.set_distance(mark, distance)
        taken = {mark.frame for mark in items}
        for frame, distance in edit.added.items():
            if frame not in taken:
                mark = items.add()
                mark.frame = frame
                focus_marks.set_distance(mark, distance)


def _is_dragging() -> bool:
    manager = bpy.context.window_manager
    return manager is not None and any(
        operator.bl_idname.startswith(DRAGGING)
        for window in manager.windows
        for operator in window.modal_operators
    )


def _is_busy() -> bool:
    """Whether the data are a render's, on whichever thread."""
    return threading.current_thread() is not threading.main_thread() or bpy.app.is_job_running("RENDER")


def _later() -> float | None:
    if _is_dragging() or _is_busy():
        return AGAIN
    take_in(bpy.context.scene)
    return None


@persistent
def _on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    if _is_busy() or lens.is_writing():
        return
    if _is_dragging():
        if not bpy.app.timers.is_registered(_later):
            bpy.app.timers.register(_later, first_interval=AGAIN)
        return
    take_in(scene)


@persistent
def _on_frame(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """A pull goes on: the camera's own property follows where somebody sees it."""
    if bpy.app.background or _is_busy():
        return
    settings = scene.virtual_aperture
    if settings.points is not None and blender_focus.edited(settings) is None:
        blender_focus.show(settings, settings.focus_distance)


def register() -> None:
    """Look from now on."""
    bpy.app.handlers.depsgraph_update_post.append(_on_update)
    bpy.app.handlers.frame_change_post.append(_on_frame)


def unregister() -> None:
    """Undo `register`."""
    bpy.app.handlers.depsgraph_update_post.remove(_on_update)
    bpy.app.handlers.frame_change_post.remove(_on_frame)
    with contextlib.suppress(ValueError):
        bpy.app.timers.unregister(_later)
