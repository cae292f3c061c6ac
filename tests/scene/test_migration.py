"""Scenes of other versions."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene import migration
from addon.scene.build import build
from addon.scene.cg_objects import cg_objects
from addon.scene.version import VERSION
from addon.ui import panels

from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def saved(scene: bpy.types.Scene, folder: Path, version: int) -> Path:
    """A .blend with a solved clip, as a version left it."""
    shot = slanted_shot(folder / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.views = 8.0, 4
    handler = next(h for h in bpy.app.handlers.save_pre if h.__module__ == migration.__name__)
    bpy.app.handlers.save_pre.remove(handler)
    try:
        settings.version = version
        if version == 2:
            settings.bl_system_properties_get(do_create=True)[migration.PSNR_OF_2] = 45.0
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "old.blend"))
    finally:
        bpy.app.handlers.save_pre.append(handler)
    return folder / "old.blend"


def test_a_file_of_version_2_keeps_its_target(scene: bpy.types.Scene, tmp_path: Path) -> None:
    blend = saved(scene, tmp_path, 2)
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    settings = bpy.context.scene.virtual_aperture
    assert settings.version == VERSION
    assert settings.target_psnr == 45.0 and settings.focus_distance == 8.0
    settings.target_psnr = 0.0
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert bpy.context.scene.virtual_aperture.target_psnr == 0.0


def test_a_file_of_version_3_knows_its_hidden_objects(scene: bpy.types.Scene, tmp_path: Path) -> None:
    cube = bpy.data.objects.new("Cube", bpy.data.meshes.new("Cube"))
    scene.collection.objects.link(cube)
    scene.virtual_aperture.hidden.add().name = "Cube"
    scene.virtual_aperture.hidden.add().name = "Deleted"
    bpy.ops.wm.open_mainfile(filepath=str(saved(scene, tmp_path, 3)))
    scene = bpy.context.scene
    assert [entry.thing for entry in scene.virtual_aperture.hidden] == [scene.objects["Cube"], None]
    assert cg_objects(scene, scene.view_layers[0]) == [scene.objects["Cube"]]
    scene.objects["Cube"].hide_set(True)
    assert cg_objects(scene, scene.view_layers[0]) == []


def test_a_scene_that_is_appended_is_brought_up_to_date(scene: bpy.types.Scene, tmp_path: Path) -> None:
    blend = saved(scene, tmp_path, 2)
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    bpy.ops.wm.append(directory=f"{blend}/Scene/", filename="Scene")
    settings = bpy.data.scenes[-1].virtual_aperture
    assert settings.points is not None and settings.version == VERSION and settings.target_psnr == 45.0


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
    shown = draw(panels.main.VIRTUAL_APERTURE_PT_main)
    assert said in " ".join(shown.texts)
    assert [p for p in panels.CLASSES if p.poll(bpy.context)] == list(panels.main.CLASSES)
    for name in ("choose_clip", "solve", "set_focus", "clear_focus", "import_solve", "restore_objects"):
        with pytest.raises(RuntimeError, match=said):
            getattr(bpy.ops.virtual_aperture, name)()
    for call in (bpy.ops.virtual_aperture.render_frame, bpy.ops.render.render):
        with pytest.raises(RuntimeError, match=said):
            call()
    # Blender's own saving leaves it what it is.
    bpy.ops.wm.save_mainfile()
    assert settings.version == VERSION + 1
    assert settings.points is not None and settings.focus_distance == 8.0
