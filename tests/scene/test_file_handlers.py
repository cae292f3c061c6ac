"""Versions that are written into files, and scenes of a newer one."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene import file_handlers
from addon.scene.base.version import VERSION
from addon.scene.build import build
from addon.ui import panels

from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def saved(scene: bpy.types.Scene, folder: Path, version: int) -> Path:
    """A .blend with a solved clip, as a version left it."""
    shot = slanted_shot(folder / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.views = 8.0, 4
    handler = next(h for h in bpy.app.handlers.save_pre if h.__module__ == file_handlers.__name__)
    bpy.app.handlers.save_pre.remove(handler)
    try:
        settings.version = version
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "old.blend"))
    finally:
        bpy.app.handlers.save_pre.append(handler)
    return folder / "old.blend"


def test_the_version_is_written_into_files(scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.virtual_aperture.footage = str(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    assert scene.virtual_aperture.version == VERSION
    # It is in the file, and not the default.
    assert scene.virtual_aperture.bl_rna.properties["version"].default == 1


def test_a_newer_file_is_neither_used_nor_overwritten(scene: bpy.types.Scene, tmp_path: Path) -> None:
    blend = saved(scene, tmp_path, VERSION + 1)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    settings = scene.virtual_aperture
    said = "with a newer Virtual Aperture; update the extension"
    shown = draw(panels.notices.VIRTUAL_APERTURE_PT_details)
    assert said in " ".join(shown.texts)
    in_sidebar = [p for p in panels.CLASSES if p.bl_region_type == "UI"]
    assert [p for p in in_sidebar if p.poll(bpy.context)] == [panels.main.VIRTUAL_APERTURE_PT_main]
    for name in ("choose_clip", "solve", "set_focus", "import_solve", "restore_objects"):
        with pytest.raises(RuntimeError, match=said):
            getattr(bpy.ops.virtual_aperture, name)()
    for call in (bpy.ops.virtual_aperture.render_frame, bpy.ops.render.render):
        with pytest.raises(RuntimeError, match=said):
            call()
    # Blender's own saving leaves it what it is.
    bpy.ops.wm.save_mainfile()
    assert settings.version == VERSION + 1
    assert settings.points is not None and settings.focus_distance == 8.0
