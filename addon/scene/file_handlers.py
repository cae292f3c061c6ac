"""Scenes that are saved, and scenes that are appended from another .blend."""

from pathlib import Path

import bpy

from .base import paths
from .base.events import at
from .base.version import VERSION
from .focus import from_1_0


@at("save_pre")
def _on_save(*_: object) -> None:
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        if scene.library is None and settings.footage and settings.version < VERSION:
            settings.version = VERSION


@at("load_post")
def _on_load(*_: object) -> None:
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        from_1_0.take_over(settings)
        # Version 1.0 had two more.
        settings.method = settings.method or "features"


@at("blend_import_post")
def _on_import(imported: bpy.types.BlendImportContext) -> None:
    """Scenes that were appended: their paths are relative to the .blend that they come from."""
    _on_load()
    for item in imported.import_items:
        if item.id_type != "SCENE" or item.id is None or item.id.library is not None:
            continue
        if item.source_library is not None:
            file = Path(bpy.path.abspath(item.source_library.filepath))
            _from_folder(item.id, str(file.parent))


def _from_folder(scene: bpy.types.Scene, folder: str) -> None:
    """Paths that were relative to a folder, relative to this .blend."""
    for owner, name in paths.owned(scene):
        if (value := getattr(owner, name)).startswith("//"):
            setattr(owner, name, paths.relative(bpy.path.abspath(value, start=folder)))


def look() -> None:
    """Bring the scenes that are open up to date, as of a file that is opened."""
    if hasattr(bpy.data, "scenes"):
        _on_load()
    else:
        # Blender hides its data while an extension is enabled.
        bpy.app.timers.register(_on_load, first_interval=0)
