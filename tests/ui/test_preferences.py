"""The extension's preferences with the real module, and the button that deletes kept depth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base import limits
from addon.core.base.store import Store, kept_size
from addon.core.sfm.state import STATE
from addon.scene.base import preferences
from addon.scene.sources.clip import work_dir
from addon.ui import panels

from ..foreign_models import write_clip, write_model
from ..in_blender import choose_clip
from ..onnx_files import red
from ..recorder import Recorder, draw


@pytest.fixture
def chosen(scene: bpy.types.Scene) -> Iterator[bpy.types.AddonPreferences]:
    """The preferences as Blender has them of an extension that is enabled."""
    addons = bpy.context.preferences.addons
    entry = addons.new()
    entry.module = preferences.PACKAGE
    found = preferences.preferences()
    assert found is not None
    yield found
    found.threads, found.segmenter = 0, ""
    limits.limit_kept_depth(0)
    addons.remove(entry)


def test_without_preferences_all_is_as_it_was(scene: bpy.types.Scene, tmp_path: Path) -> None:
    assert preferences.preferences() is None
    clip = tmp_path / "walk.mp4"
    assert work_dir(scene.virtual_aperture, clip) == tmp_path / "walk.aperture"


def test_the_cache_folder_takes_working_folders(
    scene: bpy.types.Scene, chosen: bpy.types.AddonPreferences, tmp_path: Path
) -> None:
    settings, cache = scene.virtual_aperture, tmp_path / "cache"
    clips = [tmp_path / name / "walk.mp4" for name in ("one", "two")]
    assert work_dir(settings, clips[0]) == clips[0].with_name("walk.aperture")
    chosen.cache_folder = str(cache)
    found = [work_dir(settings, clip) for clip in clips]
    assert found[0] != found[1]
    assert {folder.parent for folder in found} == {cache}
    assert all(folder.name.startswith("walk-") and folder.suffix == ".aperture" for folder in found)
    # What is solved stays in use; what is set counts.
    beside = clips[1].with_name("walk.aperture")
    beside.mkdir(parents=True)
    (beside / STATE).write_text("{}")
    assert work_dir(settings, clips[1]) == beside
    settings.work_dir = str(tmp_path / "own")
    assert work_dir(settings, clips[0]) == tmp_path / "own"


def test_limits_follow_the_preferences(chosen: bpy.types.AddonPreferences) -> None:
    assert limits.most_kept_depth() == limits.MOST_KEPT_DEPTH
    chosen.threads, chosen.kept_depth = 1, 2.0
    assert limits.threads() == 1
    assert limits.most_kept_depth() == 2 << 30


def shown(chosen: bpy.types.AddonPreferences) -> str:
    """The texts of the preferences."""

    class Shown:
        layout = Recorder()

        def __getattr__(self, name: str) -> object:
            return getattr(chosen, name)

        @property
        def bl_rna(self) -> bpy.types.Struct:
            return chosen.bl_rna

    seen = Shown()
    panels.preferences.VIRTUAL_APERTURE_preferences.draw(seen, bpy.context)
    return " ".join(seen.layout.texts)


def test_a_segmenter_is_tried_and_taken_by_scenes_without_one(
    scene: bpy.types.Scene, chosen: bpy.types.AddonPreferences, tmp_path: Path
) -> None:
    own = tmp_path / "net.onnx"
    own.write_bytes(red(times=-40.0))
    chosen.segmenter = str(own)
    assert "net.onnx does not find the disc of a test picture" in shown(chosen)
    assert not scene.virtual_aperture.segmenter
    own.write_bytes(red())
    chosen.segmenter = str(own)
    assert "check that their terms allow your use" in shown(chosen)
    assert scene.virtual_aperture.segmenter == str(own)
    # A scene's own one stays, and a new solve takes the preferred one.
    scene.virtual_aperture.segmenter = "other.onnx"
    chosen.segmenter = str(own)
    assert scene.virtual_aperture.segmenter == "other.onnx"
    scene.virtual_aperture.segmenter = ""
    scene.virtual_aperture.footage = str(write_clip(tmp_path / "clip"))
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "model")))
    assert scene.virtual_aperture.segmenter == str(own)


def test_kept_depth_is_shown_and_deleted(scene: bpy.types.Scene, tmp_path: Path) -> None:
    delete, files = bpy.ops.virtual_aperture.delete_depth, panels.solve.VIRTUAL_APERTURE_PT_clip
    with pytest.raises(RuntimeError, match="Choose a clip first"):
        delete()
    work = choose_clip(scene, tmp_path)
    with pytest.raises(RuntimeError, match="No depth is kept for this clip"):
        delete()
    assert "virtual_aperture.delete_depth" not in draw(files).operators
    from addon.ui.panels.preferences import _sizes

    _sizes.clear()
    for key in ("old", "new"):
        Store(work / "depth", lambda key=key: key).write("depth-000001", {"inverse": np.zeros((8, 8))})
    (work / "depth" / "old" / "notes.txt").write_text("mine")
    assert kept_size(work / "depth") > 0
    assert any(text.startswith("Delete Kept Depth (0.0 MB") for text in draw(files).texts)
    assert delete() == {"FINISHED"}
    left = [path.name for path in (work / "depth").rglob("*") if path.is_file()]
    assert left == ["notes.txt"]
    assert "virtual_aperture.delete_depth" not in draw(files).operators
