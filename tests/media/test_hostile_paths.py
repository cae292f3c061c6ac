"""Names, places and shapes that nobody expects: used as they are, or refused in one readable line."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.user_maps import open_depth
from addon.core.media.clip import open_footage
from addon.core.media.clip_identity import clip_exists
from addon.core.media.masks import open_masks
from addon.core.sfm.state import Staging
from addon.core.sfm.workspace import load_solve
from addon.render.output import output
from addon.scene.build import build
from addon.scene.sources import shot
from addon.ui.footage.file_import import clip_of

from ..command_line import run
from ..scenes import LENS, slanted_plane, write_frames
from ..slanted_clip import LENS_OPTIONS, keep, listed, video

FOREIGN = os.fsdecode(b"na\xefve")
"""A name in Latin-1."""


@pytest.mark.parametrize("name", ["100%d {a} ###.mp4", "'quoted' \"x\" $HOME;.mp4"])
def test_videos_by_any_name(
    tmp_path: Path, scene: bpy.types.Scene, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    clip, work = video(tmp_path / name), tmp_path / "work"
    assert open_footage(clip).is_video and clip_exists(clip) and clip_of(clip) == clip
    keep(clip, work)
    assert load_solve(work).footage == clip
    assert run("render", work, *LENS_OPTIONS, "--frames", "2", "--out", tmp_path / "o" / "####.png") == 0
    assert list(listed(tmp_path / "o")) == ["0002.png"]
    assert run("save", work, "--blend", tmp_path / "send" / "a.blend") == 0
    assert sorted(listed(tmp_path / "send")) == sorted(["a.blend", name])
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "send" / "a.blend"))
    assert shot.shot_of(bpy.context.scene).footage.path == tmp_path / "send" / name
    shot.forget()


def test_sequences_by_any_name(tmp_path: Path) -> None:
    folder = write_frames(tmp_path / "take #3 %d", LENS)
    assert open_footage(folder).frames == (1, 2, 3)
    for path in sorted(folder.iterdir()):
        path.rename(folder / path.name.replace("clip", "{a} #3 100%d"))
    for name in ("{a} #3 100%d_####.png", "{a} #3 100%d_%04d.png"):
        assert open_footage(folder / name).frames == (1, 2, 3)
    chosen = clip_of(folder / "{a} #3 100%d_0002.png")
    assert open_footage(chosen).frames == (1, 2, 3)
    assert open_masks(folder / "{a} #3 100%d_0002.png", open_footage(folder)).frames == (1, 2, 3)
    # Where all places are numbers, they are.
    (tmp_path / "shots").mkdir()
    for number in (1, 2):
        shutil.copy(folder / "{a} #3 100%d_0001.png", tmp_path / "shots" / f"s7_{number:03d}.png")
    assert open_footage(tmp_path / "shots" / "s#_###.png").frames == (1, 2)
    with pytest.raises(UserError, match="has no images"):
        open_footage(tmp_path / "shots" / "t#_###.png")


def test_two_slashes_in_front(tmp_path: Path, scene: bpy.types.Scene) -> None:
    clip, work = write_frames(tmp_path / "clip", LENS), tmp_path / "work"
    model = tmp_path / "model"
    keep(clip, work)
    assert run("export", f"/{work}", "--model", f"//{model}") == 0
    assert run("import", f"/{model}", "--footage", f"/{clip}", "--work", f"/{tmp_path}/again") == 0
    assert load_solve(tmp_path / "again").footage == clip
    out = tmp_path / "o" / "####.png"
    assert (
        run("render", f"/{work}", *LENS_OPTIONS, "--frames", 1, "--mask", f"/{clip}", "--out", f"/{out}") == 0
    )
    assert list(listed(out.parent)) == ["0001.png"]
    assert run("save", f"/{work}", "--blend", f"/{tmp_path}/send/a.blend") == 0
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "send" / "a.blend"))
    assert shot.shot_of(bpy.context.scene).footage.path == tmp_path / "send" / "clip_frames"


def test_names_that_are_not_utf8_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clip, work = write_frames(tmp_path / "clip", LENS), tmp_path / "work"
    keep(clip, work)
    bad = tmp_path / FOREIGN
    shutil.copytree(clip, bad)
    keys = ("render", work, *LENS_OPTIONS)
    for command in (
        ("solve", bad, "--work", tmp_path / "w"),
        ("solve", clip, "--work", bad / "w"),
        ("run", bad / "clip_####.png", *LENS_OPTIONS, "--out", tmp_path / "o.mp4"),
        (*keys, "--out", bad / "####.png"),
        (*keys, "--out", tmp_path / f"{FOREIGN}.mp4"),
        (*keys, "--out", tmp_path / "o.mp4", "--mask", bad),
        (*keys, "--out", tmp_path / "o.mp4", "--depth", bad / "clip_####.png"),
        (*keys, "--out", tmp_path / "o.mp4", "--report", tmp_path / f"{FOREIGN}.json"),
        ("save", work, "--blend", bad / "a.blend"),
    ):
        assert run(*command) == 1
        said = capsys.readouterr().err
        assert "(not UTF-8)" in said and r"na\xefve" in said and len(said.splitlines()) == 1
    assert sorted(listed(bad)) == [f"clip_000{n}.png" for n in (1, 2, 3)]
    shutil.copy(clip / "clip_0001.png", clip / f"{FOREIGN}_0004.png")
    with pytest.raises(UserError, match="not UTF-8"):
        open_footage(clip)


@pytest.mark.skipif(os.sep == "\\", reason="backslashes separate folders there")
def test_names_with_backslashes_are_refused_before_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, clip, work = "C:\\clips", write_frames(tmp_path / "clip", LENS), tmp_path / "work"
    film, bad = video(tmp_path / "film.mp4"), tmp_path / name
    keep(clip, work)
    shutil.copytree(clip, bad)
    shutil.copy(film, tmp_path / f"{name}.mp4")
    (tmp_path / "way").symlink_to(bad)
    before = sorted(tmp_path.rglob("*"))
    keys = ("render", work, *LENS_OPTIONS)
    for command in (
        ("solve", bad, "--work", tmp_path / "w"),
        ("solve", tmp_path / f"{name}.mp4", "--work", tmp_path / "w"),
        ("solve", tmp_path / "way", "--work", tmp_path / "w"),
        ("solve", clip, "--work", bad / "w"),
        ("run", bad / "clip_####.png", *LENS_OPTIONS, "--out", tmp_path / "o.mp4"),
        ("run", film, *LENS_OPTIONS, "--work", bad / "w", "--out", tmp_path / "o.mp4"),
        (*keys, "--out", bad / "####.png"),
        (*keys, "--out", tmp_path / "new" / f"{name}.mp4"),
        (*keys, "--out", tmp_path / "o.mp4", "--mask", bad),
        (*keys, "--out", tmp_path / "o.mp4", "--depth", bad / "clip_####.png"),
        (*keys, "--out", tmp_path / "o.mp4", "--aperture", f"image={bad / 'clip_0001.png'}"),
        (*keys, "--out", tmp_path / "o.mp4", "--report", tmp_path / f"{name}.json"),
        ("save", work, "--blend", bad / "a.blend"),
        ("render", bad / "a.blend", "--out", tmp_path / "o.mp4"),
        ("farm", bad, *LENS_OPTIONS, "--out", tmp_path / "job"),
        ("export", work, "--model", bad / "model"),
    ):
        assert run(*command) == 1, command
        said = capsys.readouterr().err
        assert "has a backslash in a name" in said and "rename the file or folder" in said, command
        assert name in said and len(said.splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before
    # Wherever they come from.
    footage = open_footage(clip)
    for call in (open_footage, lambda p: open_masks(p, footage), lambda p: open_depth(p, footage)):
        with pytest.raises(UserError, match="backslash"):
            call(bad)
    for make in (Staging, load_solve, lambda p: output.check_output(p / "o.mp4", False)):
        with pytest.raises(UserError, match="backslash"):
            make(bad / "w")
    shutil.copy(clip / "clip_0001.png", clip / f"{name}_0004.png")
    with pytest.raises(UserError, match="backslash"):
        open_footage(clip)


def test_a_folder_that_is_not_utf8_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / FOREIGN).mkdir()
    video(tmp_path / "clip.mp4").rename(tmp_path / FOREIGN / "clip.mp4")
    monkeypatch.chdir(tmp_path / FOREIGN)
    assert run("solve", "clip.mp4", "--work", "w") == 1
    assert "(not UTF-8)" in capsys.readouterr().err


def test_nothing_is_written_over_its_source(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: bpy.types.Scene
) -> None:
    film, filmed = video(tmp_path / "film.mp4"), tmp_path / "film.aperture"
    frames, work = write_frames(tmp_path / "x.mp4.frames", LENS), tmp_path / "work"
    masks, depth = (write_frames(tmp_path / name, LENS) for name in ("masks", "depth"))
    keep(film, filmed)
    keep(frames, work)
    os.link(film, tmp_path / "linked.mp4")
    (tmp_path / "way").symlink_to(frames, target_is_directory=True)
    before = {folder: listed(folder) for folder in (frames, masks, depth)} | {film: film.read_bytes()}
    beside = ("--mask", masks / "clip_0001.png", "--depth", depth)
    for command in (
        ("render", filmed, "--out", film),
        ("render", filmed, "--out", tmp_path / "linked.mp4"),
        ("run", film, "--work", filmed, "--out", film),
        ("render", work, "--out", frames / "clip_####.png"),
        ("render", work, "--out", tmp_path / "way" / "new_####.png"),
        ("render", work, *beside, "--out", masks / "clip_####.png"),
        ("render", work, *beside, "--out", depth / "clip_####.png"),
        ("inspect", work, "--frame", 1, "--out", frames),
    ):
        assert run(*command, *LENS_OPTIONS, "--overwrite") == 1, command
        assert "is one of the files the frames are made from" in capsys.readouterr().err
    assert run("render", work, "--out", tmp_path / "x.mp4", *LENS_OPTIONS, "--overwrite") == 1
    assert "clip_0001.png does not come from a run that makes x.mp4" in capsys.readouterr().err
    assert before == {folder: listed(folder) for folder in (frames, masks, depth)} | {film: film.read_bytes()}
    # A movie beside the pictures is none of them.
    output.check_apart([frames / "o.mp4", frames / "o.mp4.frames"], [frames, masks])


@pytest.mark.parametrize("size", [(4000, 2), (1, 50), (4000, 30)])
def test_pictures_of_absurd_shapes_end_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: tuple[int, int]
) -> None:
    folder = tmp_path / "clip"
    folder.mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (size[1], size[0] + 20, 3), np.uint8)
    for frame in range(1, 6):
        cv2.imwrite(str(folder / f"a_{frame}.png"), noise[:, 3 * frame : 3 * frame + size[0]])
    assert run_command(["solve", str(folder), "--work", str(tmp_path / "work")]) == 1
    said = capsys.readouterr().err
    assert f"is {size[0]}x{size[1]} pixels; features can only be followed" in said
    assert len(said.splitlines()) == 1 and not (tmp_path / "work").exists()


@pytest.mark.parametrize("size", [(4000, 2), (1, 1)])
def test_pictures_that_blender_cannot_render_are_refused(
    tmp_path: Path, scene: bpy.types.Scene, size: tuple[int, int]
) -> None:
    camera = Intrinsics(*size, 100.0, 100.0, size[0] / 2, size[1] / 2)
    footage = open_footage(write_frames(tmp_path / "clip", camera))
    with pytest.raises(UserError, match="Blender cannot render images smaller than 4 pixels"):
        build(scene, footage, slanted_plane(camera))
