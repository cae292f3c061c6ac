"""The clip of a scene's solve: another one chosen, a project that is saved and moved, a clip that is gone."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.scene.sources import clip
from addon.scene.sources.shot import shot_of

from ..scenes import slanted_plane, texture, write_frames

ROOT = Path(__file__).resolve().parents[2]
LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


@pytest.fixture(autouse=True)
def _nothing_is_remembered() -> None:
    clip.forget()


def write_video(path: Path, seed: int = 0) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (LENS.width, LENS.height))
    for _ in range(3):
        writer.write(np.ascontiguousarray(texture(LENS.width, LENS.height, seed)[..., ::-1]))
    writer.release()
    return path


def set_up(scene: bpy.types.Scene, footage: Path) -> bpy.types.PropertyGroup:
    settings = build(scene, open_footage(footage), slanted_plane(LENS))
    settings.focus_distance, settings.views, settings.method = 8.0, 4, "features"
    return settings


def save(path: Path, **how: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False, **how)


def test_another_clip_is_not_rendered_with_this_solve(scene: bpy.types.Scene, tmp_path: Path) -> None:
    desk, other = write_video(tmp_path / "desk.mp4"), write_video(tmp_path / "other.mp4", 1)
    settings = set_up(scene, desk)
    shot_of(scene)
    settings.footage = str(other)
    said = (
        "the solve belongs to desk.mp4, but the chosen clip is other.mp4; solve it, or choose desk.mp4 again"
    )
    with pytest.raises(UserError, match=said):
        shot_of(scene)
    with pytest.raises(RuntimeError, match=said + r" \(Solve Clip\)"):
        bpy.ops.virtual_aperture.render_frame()
    settings.footage = str(desk)
    assert shot_of(scene).footage.path == desk
    # Other pictures under the same name.
    shutil.copy(other, desk)
    os.utime(desk, ns=(1, 1))
    with pytest.raises(UserError, match=r"desk.mp4 is not the desk\.mp4 that was solved"):
        shot_of(scene)


def test_the_same_clip_by_another_path_is_the_same_clip(scene: bpy.types.Scene, tmp_path: Path) -> None:
    desk = write_video(tmp_path / "desk.mp4")
    settings = set_up(scene, desk)
    settings.footage = str(shutil.copy(desk, tmp_path / "copied.mp4"))
    assert shot_of(scene).footage.path == tmp_path / "copied.mp4"
    frames = write_frames(tmp_path / "frames", LENS)
    settings = set_up(scene, frames)
    settings.footage = str(frames / "clip_####.png")
    assert shot_of(scene).footage.path == frames / "clip_####.png"
    write_frames(frames, LENS, (4,))
    with pytest.raises(UserError, match=r"solve belongs to frames, but the chosen clip is clip_####\.png"):
        shot_of(scene)


def test_paths_are_relative_in_what_is_saved(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = set_up(scene, write_video(tmp_path / "a" / "desk.mp4"))
    settings.work_dir, settings.masks = str(tmp_path / "a" / "work"), str(tmp_path / "masks")
    other = bpy.data.scenes.new("other")
    other.virtual_aperture.footage = str(tmp_path / "a" / "other.mp4")

    def kept() -> list[str]:
        return [settings.footage, settings.work_dir, settings.masks, other.virtual_aperture.footage]

    save(tmp_path / "a" / "x.blend")
    first = ["//desk.mp4", "//work", "//../masks", "//other.mp4"]
    assert kept() == first
    # The open file stays as it is, whether a copy is written or nothing can be.
    save(tmp_path / "b" / "c" / "copy.blend", copy=True)
    assert kept() == first
    with pytest.raises(RuntimeError):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "none" / "x.blend"), check_existing=False)
    assert kept() == first
    save(tmp_path / "b" / "x.blend")
    assert kept() == ["//../a/desk.mp4", "//../a/work", "//../masks", "//../a/other.mp4"]
    image = settings.camera.data.background_images[0].image
    assert image.filepath == "//../a/desk.mp4"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b" / "c" / "copy.blend"))
    settings = bpy.context.scene.virtual_aperture
    assert settings.footage == "//../../a/desk.mp4"
    assert clip.solved_clip_path(settings) == tmp_path / "a" / "desk.mp4"


def test_the_output_that_a_solve_set_moves_along_and_the_users_own_stays(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    scene.render.filepath = "/tmp/"
    set_up(scene, write_video(tmp_path / "clips" / "desk.mp4"))
    assert scene.render.filepath == str(tmp_path / "clips" / "desk_render") + os.sep
    save(tmp_path / "scenes" / "a.blend")
    assert scene.render.filepath == scene.virtual_aperture.output == "//../clips/desk_render/"
    # A copy elsewhere has its own, and the open file keeps this one.
    save(tmp_path / "b.blend", copy=True)
    assert scene.render.filepath == "//../clips/desk_render/"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b.blend"))
    scene = bpy.context.scene
    assert scene.render.filepath == "//clips/desk_render/"
    scene.render.filepath = str(tmp_path / "mine")
    save(tmp_path / "b.blend")
    assert scene.render.filepath == str(tmp_path / "mine")


def test_a_clip_that_is_solved_in_a_saved_file_is_relative_at_once(
    scene: bpy.types.Scene, tmp_path: Path
) -> None:
    save(tmp_path / "a" / "x.blend")
    settings = set_up(bpy.context.scene, write_video(tmp_path / "a" / "desk.mp4"))
    image = settings.camera.data.background_images[0].image
    assert (settings.footage, image.filepath) == ("//desk.mp4", "//desk.mp4")
    assert image.size[0] == LENS.width


def rendered(blend: Path, out: Path) -> tuple[np.ndarray | None, str]:
    """A frame that a new process renders of a .blend, and what it said."""
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import bpy, addon; addon.register();"
        "bpy.ops.wm.open_mainfile(filepath=sys.argv[2]); s = bpy.context.scene;"
        "s.render.filepath = sys.argv[3]; bpy.ops.render.render(write_still=True);"
        "i = s.virtual_aperture.camera.data.background_images[0].image; print('BACKGROUND', i.size[0]);"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(ROOT), str(blend), str(out)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return cv2.imread(str(out)), done.stdout + done.stderr


@pytest.mark.long
def test_a_moved_project_renders_the_same_picture(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = set_up(scene, write_video(tmp_path / "a" / "desk.mp4"))
    settings.work_dir = str(tmp_path / "a" / "work")
    save(tmp_path / "a" / "x.blend")
    before, _ = rendered(tmp_path / "a" / "x.blend", tmp_path / "before.png")
    moved = Path(shutil.move(tmp_path / "a", tmp_path / "b"))
    after, said = rendered(moved / "x.blend", tmp_path / "after.png")
    assert f"BACKGROUND {LENS.width}" in said
    assert before is not None and before.std() > 10
    np.testing.assert_array_equal(before, after)
    # Below the .blend, and called the same.
    (moved / "footage" / "day1").mkdir(parents=True)
    (moved / "desk.mp4").rename(moved / "footage" / "day1" / "desk.mp4")
    after, _ = rendered(moved / "x.blend", tmp_path / "below.png")
    np.testing.assert_array_equal(before, after)
    # Another clip of the same name is not taken for it.
    write_video(moved / "footage" / "day1" / "desk.mp4", 1)
    after, said = rendered(moved / "x.blend", tmp_path / "gone.png")
    assert after is None
    assert f"the clip desk.mp4 is missing from {moved}, and is not next to the .blend or below it" in said


def test_a_clip_is_found_where_its_working_folder_says(scene: bpy.types.Scene, tmp_path: Path) -> None:
    work = tmp_path / "p" / "work"
    work.mkdir(parents=True)
    settings = set_up(scene, write_video(tmp_path / "p" / "clips" / "desk.mp4"))
    (work / "solve.json").write_text(
        '{"version": 1, "footage": "/gone.mp4", "relative": "../clips/desk.mp4", "identity": "",'
        ' "frames": [1], "report": {}}'
    )
    settings.work_dir = str(work)
    settings.footage = str(tmp_path / "gone.mp4")
    assert clip.solved_clip_path(settings) == tmp_path / "p" / "clips" / "desk.mp4"


def test_the_user_shows_where_the_clip_is(scene: bpy.types.Scene, tmp_path: Path) -> None:
    desk = write_video(tmp_path / "desk.mp4")
    settings = set_up(scene, desk)
    wrong = write_video(tmp_path / "wrong.mp4", 1)
    elsewhere = tmp_path / "far" / "away.mp4"
    elsewhere.parent.mkdir()
    desk.rename(elsewhere)
    with pytest.raises(RuntimeError, match=r"wrong.mp4 is not the clip that was solved, desk.mp4"):
        bpy.ops.virtual_aperture.find_clip(filepath=str(wrong))
    trouble = clip.trouble_with(settings)
    assert trouble is not None and trouble.is_missing and trouble.found is None
    assert bpy.ops.virtual_aperture.find_clip(filepath=str(elsewhere)) == {"FINISHED"}
    assert clip.trouble_with(settings) is None
    assert shot_of(scene).footage.path == elsewhere
    assert settings.camera.data.background_images[0].image.filepath == str(elsewhere)
    # Of a sequence, any of its pictures.
    frames = write_frames(tmp_path / "frames", LENS)
    for chosen in (frames, frames / "clip_####.png"):
        settings = set_up(scene, chosen)
        moved = frames.rename(tmp_path / "moved")
        picture = moved / "clip_0002.png"
        assert bpy.ops.virtual_aperture.find_clip(filepath=str(picture)) == {"FINISHED"}
        assert shot_of(scene).footage.path == (moved if chosen == frames else moved / chosen.name)
        assert settings.camera.data.background_images[0].image.filepath == str(moved / "clip_0001.png")
        moved.rename(frames)
