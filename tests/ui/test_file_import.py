"""File > Import and files dropped on the viewport, with the real module."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.scene.build import build
from addon.ui.base.solving import Solving
from addon.ui.footage import file_import

from .. import planes
from ..foreign_models import write_clip, write_model
from ..in_blender import choose_clip
from ..scenes import slanted_shot, write_frames

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


def test_a_clip_is_chosen_and_solved_by_any_of_its_pictures(scene: bpy.types.Scene, tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    picture = sorted(clip.iterdir())[3]
    assert bpy.ops.virtual_aperture.import_clip(filepath=str(picture)) == {"FINISHED"}
    settings = scene.virtual_aperture
    assert len(settings.points.data.vertices) > 50
    assert Path(settings.footage).parent == clip and "#" in settings.footage
    state = next(tmp_path.rglob("solve.json"))
    before = state.stat().st_mtime_ns
    # What is kept is loaded.
    settings.points = None
    assert bpy.ops.virtual_aperture.import_clip("INVOKE_DEFAULT", filepath=str(picture)) == {"FINISHED"}
    assert settings.points is not None and state.stat().st_mtime_ns == before


def test_what_is_no_clip_is_refused_and_nothing_chosen(scene: bpy.types.Scene, tmp_path: Path) -> None:
    (tmp_path / "cat.png").write_bytes(b"")
    for path, said in (
        ("", "no clip has been chosen; choose a video"),
        (tmp_path / "gone.mp4", "does not exist; choose a video"),
        (tmp_path / "cat.png", "single image without a frame number"),
    ):
        with pytest.raises(RuntimeError, match=said):
            bpy.ops.virtual_aperture.import_clip(filepath=str(path))
    (tmp_path / "broken.mp4").write_bytes(b"no film")
    with pytest.raises(RuntimeError, match=r"^Error: .*broken\.mp4"):
        bpy.ops.virtual_aperture.import_clip(filepath=str(tmp_path / "broken.mp4"))
    assert scene.virtual_aperture.footage == ""
    assert scene.virtual_aperture.points is None


def test_a_clip_is_refused_while_another_is_solved(scene: bpy.types.Scene, tmp_path: Path) -> None:
    choose_clip(scene, tmp_path)
    other = write_clip(tmp_path / "other")

    def begin() -> None:
        raise AssertionError

    Solving.running = Solving(begin)
    try:
        for name, path in (("import_clip", other), ("drop_model", other / "cameras.bin")):
            with pytest.raises(RuntimeError, match=r"being solved; .*ESC, then .* again"):
                getattr(bpy.ops.virtual_aperture, name)(filepath=str(path))
    finally:
        Solving.running = None
    assert scene.virtual_aperture.footage == str(tmp_path / "clip")


def test_only_a_focus_of_another_clip_is_lost(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "one", LENS)
    other = write_clip(tmp_path / "two")
    settings = build(scene, shot.footage, shot.reconstruction)
    assert not file_import.loses_focus(settings, other)
    settings.focus_distance = 7.0
    assert file_import.loses_focus(settings, other)
    assert not file_import.loses_focus(settings, shot.footage.path)


def test_a_clip_can_have_a_scene_of_its_own(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "one", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance = 7.0
    before = settings.footage, settings.points, len(bpy.data.scenes)
    clip = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    assert bpy.ops.virtual_aperture.import_clip(filepath=str(clip), into="NEW") == {"FINISHED"}
    made = bpy.context.window.scene
    assert made != scene and made.name == clip.stem and made.virtual_aperture.points is not None
    assert made.virtual_aperture.points != settings.points
    assert (settings.footage, settings.points, len(bpy.data.scenes) - 1) == before
    assert settings.focus_distance == 7.0
    bpy.data.scenes.remove(made)
    still = write_frames(tmp_path / "still", LENS, tuple(range(1, 13)))
    with pytest.raises(RuntimeError):
        bpy.ops.virtual_aperture.import_clip(filepath=str(still), into="NEW")
    assert bpy.context.window.scene == scene and len(bpy.data.scenes) == before[2]


@pytest.mark.long
def test_the_folder_of_another_clip_is_left(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "model")))
    settings, clip = scene.virtual_aperture, tmp_path / "clip"
    assert file_import.folder_for(settings, clip) == str(work)
    other = planes.write_clip(tmp_path / "walk", planes.sideways(12))
    assert file_import.folder_for(settings, other) == ""
    assert bpy.ops.virtual_aperture.import_clip(filepath=str(other)) == {"FINISHED"}
    assert settings.work_dir == ""


def test_a_clip_that_cannot_be_solved_leaves_the_solved_one(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = choose_clip(scene, tmp_path)
    bpy.ops.virtual_aperture.import_solve(filepath=str(write_model(tmp_path / "model")))
    settings = scene.virtual_aperture
    before = settings.footage, str(work), settings.points, settings.summary
    still = write_frames(tmp_path / "still", LENS, tuple(range(1, 13)))
    with pytest.raises(RuntimeError):
        bpy.ops.virtual_aperture.import_clip(filepath=str(still))
    assert (settings.footage, settings.work_dir, settings.points, settings.summary) == before


def test_a_model_is_imported_for_the_chosen_clip(scene: bpy.types.Scene, tmp_path: Path) -> None:
    model = write_model(tmp_path / "model") / "cameras.txt"
    with pytest.raises(
        RuntimeError,
        match=r"cameras\.txt is a solve, but no clip has been chosen for it; drop",
    ):
        bpy.ops.virtual_aperture.drop_model(filepath=str(model))
    choose_clip(scene, tmp_path)
    notes = tmp_path / "notes.txt"
    notes.write_text("Things to do")
    with pytest.raises(RuntimeError, match="not a model in a known format"):
        bpy.ops.virtual_aperture.drop_model(filepath=str(notes))
    assert scene.virtual_aperture.points is None
    assert bpy.ops.virtual_aperture.drop_model(filepath=str(model)) == {"FINISHED"}
    assert len(scene.virtual_aperture.points.data.vertices) == 12


def test_viewports_take_what_the_operators_do(scene: bpy.types.Scene) -> None:
    for handler, endings in (
        (bpy.types.VIRTUAL_APERTURE_FH_clip, (".mp4", ".mov", ".png", ".exr")),
        (bpy.types.VIRTUAL_APERTURE_FH_model, (".bin", ".txt", ".out", ".nvm")),
    ):
        assert set(endings) <= set(handler.bl_file_extensions.split(";"))
        group, name = handler.bl_import_operator.split(".")
        operator = getattr(bpy.types, f"{group.upper()}_OT_{name}")
        assert "UNDO" in operator.bl_options
        filepath = (
            operator.bl_rna.properties.get("filepath")
            or getattr(bpy.ops.virtual_aperture, name).get_rna_type().properties["filepath"]
        )
        assert filepath.is_skip_save and filepath.subtype == "FILE_PATH"
        for area in bpy.context.screen.areas:
            with bpy.context.temp_override(area=area):
                assert handler.poll_drop(bpy.context) == (area.type == "VIEW_3D")
