"""Scenes that another version of this extension made, or that were taken over from another .blend.

`VirtualApertureSettings.version` is written when a scene is saved. Files from before that was so hold none,
and read as the first version.
"""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from . import blender_focus, lens, paths
from .version import VERSION

PSNR_OF_2 = "error"
"""Name of the target PSNR in version 2."""
CHOSEN_OF_2 = "use_radius"
"""Name in version 2 of whether the radius counted."""


def migrate(scene: bpy.types.Scene) -> None:
    """Bring a scene that an older version made up to date; nothing is done to a newer or a linked one."""
    settings = scene.virtual_aperture
    if scene.library is not None or settings.version >= VERSION:
        return
    held = settings.bl_system_properties_get()
    if held is not None and not held.get(CHOSEN_OF_2, True):
        with lens.writing():
            settings.aperture_radius = 0.0
    if held is not None and PSNR_OF_2 in held:
        settings.target_psnr = held[PSNR_OF_2]
        del held[PSNR_OF_2]
    for entry in settings.hidden:
        entry.thing = entry.thing or scene.objects.get(entry.name)
    # It was written there at every change.
    blender_focus.follow(settings)
    settings.version = VERSION


def _on_load(*_: object) -> None:
    for scene in bpy.data.scenes:
        if scene.virtual_aperture.footage:
            migrate(scene)


def _on_save(*_: object) -> None:
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        if scene.library is None and settings.footage and settings.version < VERSION:
            settings.version = VERSION


def _on_import(imported: bpy.types.BlendImportContext) -> None:
    """Scenes that were appended: their paths are relative to the .blend that they come from."""
    for item in imported.import_items:
        if item.id_type != "SCENE" or item.id is None or item.id.library is not None:
            continue
        if item.source_library is not None:
            file = Path(bpy.path.abspath(item.source_library.filepath))
            _from_folder(item.id, str(file.parent))
        if item.id.virtual_aperture.footage:
            migrate(item.id)


def _from_folder(scene: bpy.types.Scene, folder: str) -> None:
    """Paths that were relative to a folder, relative to this .blend."""
    for owner, name in paths.owned(scene):
        if (value := getattr(owner, name)).startswith("//"):
            setattr(owner, name, paths.relative(bpy.path.abspath(value, start=folder)))


_HANDLERS = [
    (bpy.app.handlers.load_post, persistent(_on_load)),
    (bpy.app.handlers.blend_import_post, persistent(_on_import)),
    (bpy.app.handlers.save_pre, persistent(_on_save)),
]


def register() -> None:
    """Look at scenes when they are loaded, appended and saved."""
    for called, ours in _HANDLERS:
        called.append(ours)


def unregister() -> None:
    """Undo `register`."""
    for called, ours in _HANDLERS:
        called.remove(ours)
