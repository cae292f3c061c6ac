"""Notes how far away an object is that is put in focus in the camera's properties, without an event."""

import bpy

from ..base.events import at
from ..gpu import main_thread
from ..lens import blender_focus


@at("depsgraph_update_post")
def _on_update(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    settings = scene.virtual_aperture
    thing = blender_focus.focus_object(settings)
    name = "" if thing is None else thing.name_full
    if settings.object_name == name:
        return
    # A render's data are its own, on whichever thread.
    if main_thread.is_here() and not bpy.app.is_job_running("RENDER"):
        away = blender_focus.distance(settings)
        settings.object_name, settings.object_distance = name, max(away or 0.0, 0.0)
        # Properties without a callback do not have the scene evaluated.
        scene.update_tag()
