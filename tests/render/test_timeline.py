"""The clip's frames and Blender's: numbers that it does not have, *Time Remapping*, and subframes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.media.clip import open_footage
from addon.core.media.sequence import LAST_FRAME
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.render.cg import cg_process
from addon.scene.base.exr import read
from addon.scene.base.timeline import clip_frame, go_to
from addon.scene.build import build

from ..command_line import done, here
from ..in_blender import place_lamp
from ..scenes import LENS, slanted_plane, slanted_shot, write_plane
from ..slanted_clip import keep

FRAMES = tuple(range(1, 9))
LENS_OPTIONS = ("--focus-distance", 8, "--blur", 0.03, "--method", "features", "--views", 4)


@pytest.fixture
def pulled(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    """A clip whose frames all differ, with a focus that is pulled and a lamp that moves."""
    plane = slanted_plane(LENS, FRAMES)
    settings = build(scene, open_footage(write_plane(tmp_path / "clip", plane)), plane)
    settings.aperture_radius, settings.method, settings.views = 0.3, "features", 4
    for frame, distance in ((1, 5.0), (8, 12.0)):
        settings.focus_distance = distance
        settings.keyframe_insert("focus_distance", frame=frame)
    lamp = place_lamp(scene, 4.0, 10)
    for frame, across in ((1, -1.0), (8, 1.0)):
        lamp.location.x = across
        lamp.keyframe_insert("location", frame=frame)
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    return scene


def picture(scene: bpy.types.Scene, out: Path) -> np.ndarray:
    """What Blender renders at the scene's present time."""
    scene.render.filepath = str(out)
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.render.render(write_still=True)
    return read(out)


@pytest.fixture
def one_process() -> Iterator[None]:
    """For the CG objects of all renders."""
    with cg_process.kept():
        yield


@pytest.mark.usefixtures("one_process")
def test_picture_focus_and_objects_are_of_one_frame(pulled: bpy.types.Scene, tmp_path: Path) -> None:
    """Of the frame that Blender's own background and camera show, the last one that has begun."""
    render, expected = pulled.render, {}
    for frame in (2, 3):
        pulled.frame_set(frame)
        expected[frame] = picture(pulled, tmp_path / "expected.exr")
    assert np.abs(expected[2] - expected[3]).mean() > 0.01
    for old, new, at, subframe, shown in (
        (100, 200, 4, 0.0, 2), (100, 200, 5, 0.0, 2), (100, 300, 9, 0.0, 3), (300, 100, 1, 0.0, 3),
        (130, 100, 2, 0.0, 2), (100, 100, 3, 0.75, 3), (100, 200, 4, 0.5, 2),
    ):  # fmt: skip
        render.frame_map_old, render.frame_map_new = old, new
        pulled.frame_set(at, subframe=subframe)
        assert clip_frame(pulled) == shown
        found = picture(pulled, tmp_path / "found.exr")
        np.testing.assert_allclose(found, expected[shown], atol=2e-4, err_msg=f"{old}:{new} at {at}")
        assert (pulled.frame_current, round(pulled.frame_subframe, 3)) == (at, subframe)


def test_numbers_beyond_blenders_last_are_refused(scene: bpy.types.Scene, tmp_path: Path) -> None:
    go_to(scene, LAST_FRAME)
    for frame in (LAST_FRAME + 1, 1100335):
        with pytest.raises(UserError, match=f"frame {frame} is beyond Blender's last frame, 1048574; number"):
            go_to(scene, frame)
    shot = slanted_shot(tmp_path / "clip", LENS)
    footage = replace(shot.footage, frames=(1100335, 1100336, 1100337))
    with pytest.raises(UserError, match="clip: frame 1100337 is beyond"):
        build(scene, footage, shot.reconstruction)


@pytest.mark.usefixtures("registered")
def test_a_camera_counter_past_a_million_gives_no_wrong_picture(tmp_path: Path) -> None:
    """Refused, or each frame its own picture."""
    clip = write_plane(tmp_path / "clip", slanted_plane(LENS))
    for path in sorted(clip.iterdir()):
        path.rename(clip / f"P110{path.stem[-4:]}.png")
    footage = open_footage(clip)
    solved = Imported(slanted_plane(LENS, footage.frames), "COLMAP text", ())
    keep_import(solved, footage, tmp_path / "work")
    ended = here("render", tmp_path / "work", *LENS_OPTIONS, "--out", tmp_path / "out" / "####.png")
    written = sorted((tmp_path / "out").glob("*")) if (tmp_path / "out").exists() else []
    if ended.returncode:
        assert "1048574" in ended.stderr and "Traceback" not in ended.stderr and not written
    else:
        # Not their bytes: each holds a key of its own.
        assert len({np.asarray(cv2.imread(str(path))).tobytes() for path in written}) == 3


@pytest.mark.usefixtures("registered")
def test_the_command_line_renders_the_clips_frames_whatever_the_remapping(tmp_path: Path) -> None:
    clip = write_plane(tmp_path / "clip", slanted_plane(LENS))
    keep(clip, tmp_path / "work")
    done("save", tmp_path / "work", *LENS_OPTIONS, "--no-copy", "--blend", tmp_path / "a.blend")
    done("render", tmp_path / "a.blend", "--out", tmp_path / "plain" / "####.png")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.context.scene.render.frame_map_new = 250
    bpy.ops.wm.save_mainfile()
    done("render", tmp_path / "a.blend", "--out", tmp_path / "mapped" / "####.png")
    for plain in (tmp_path / "plain").iterdir():
        assert (tmp_path / "mapped" / plain.name).read_bytes() == plain.read_bytes()


def test_picks_and_marks_are_of_the_frame_that_is_shown(pulled: bpy.types.Scene) -> None:
    pulled.animation_data_clear()
    pulled.render.frame_map_new = 200
    pulled.frame_set(7)
    assert bpy.ops.virtual_aperture.pick_focus(x=0.5, y=0.5) == {"FINISHED"}
    assert [mark.frame for mark in pulled.virtual_aperture.marks.items] == [3]
