"""Chooses the aperture after an object is put in focus in the camera's properties, without an event."""

import bpy
from bpy.app.handlers import persistent

from ..gpu import main_thread
from ..lens import blender_focus, lens


@persistent
def _on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    settings = scene.virtual_aperture
    if settings.points is None or settings.aperture_radius > 0 or lens.is_writing():
        return
    # A render's data are its own, on whichever thread.
    if not main_thread.is_here() or bpy.app.is_job_running("RENDER"):
        return
    if blender_focus.distance(settings) is not None:
        with lens.writing():
            lens.on_focus(settings)


def register() -> None:
    """Look from now on."""
    bpy.app.handlers.depsgraph_update_post.append(_on_update)


def unregister() -> None:
    """Undo `register`."""
    bpy.app.handlers.depsgraph_update_post.remove(_on_update)
