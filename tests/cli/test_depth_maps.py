"""Depth maps of the user's on the command line: whose they are, and which are refused before any work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.media.clip import FrameRange, open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.scene.sources.shot import shot_of

from ..command_line import done, here
from ..scenes import LENS, slanted_plane, write_plane

LENS_OPTIONS = ("--focus-distance", 8, "--blur", 0.03, "--views", 4)
CLIP = tuple(range(1, 9))

pytestmark = pytest.mark.usefixtures("registered")


def solved(folder: Path, frames: tuple[int, ...] = CLIP) -> Path:
    """A working folder with the solve of a part of the slanted plane's clip."""
    clip = write_plane(folder / "clip", slanted_plane(LENS, CLIP))
    part = open_footage(clip, FrameRange(frames[0], frames[-1]))
    keep_import(Imported(slanted_plane(LENS, frames), "COLMAP text", ()), part, folder / "work")
    return folder / "work"


def depth() -> np.ndarray:
    """(H, W) depth of the plane at its first camera."""
    share = np.tile((np.arange(LENS.width) + 0.5) / LENS.width, (LENS.height, 1))
    return np.asarray(1 / ((1 - share) / 5.0 + share / 12.0))


def write(folder: Path, numbers: Sequence[int]) -> Path:
    folder.mkdir()
    for number in numbers:
        cv2.imwrite(str(folder / f"z_{number:04d}.png"), (1000 * depth()).astype(np.uint16))
    return folder


def test_maps_of_every_second_frame_are_refused(tmp_path: Path) -> None:
    work, out = solved(tmp_path), tmp_path / "out" / "####.png"
    maps = write(tmp_path / "maps", range(1, 5))
    ended = here("render", work, *LENS_OPTIONS, "--depth", maps, "--out", out)
    assert ended.returncode == 1 and not out.parent.exists()
    said = "maps has 4 depth maps, numbered 1 to 4, and the clip 8 frames: it is not clear which they belong"
    assert said in ended.stderr
    for place, path in reversed(list(enumerate(sorted(maps.iterdir())))):
        path.rename(maps / f"z_{2 * place + 1:04d}.png")
    said = done("render", work, *LENS_OPTIONS, "--depth", maps, "--frames", "1-2", "--out", out)
    assert "4 of 8 frames without a depth map" in said


def test_maps_of_the_solved_part_are_its_own_at_each_step(tmp_path: Path) -> None:
    """The render knows the whole clip, the command only what was solved: both match the same frames."""
    work = solved(tmp_path, (3, 4, 5))
    maps = write(tmp_path / "maps", range(3))
    said = done("save", work, *LENS_OPTIONS, "--depth", maps, "--no-copy", "--blend", tmp_path / "a.blend")
    assert "depth maps belong to the clip in order" in said
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    depth = shot_of(bpy.context.scene).depth
    assert depth is not None and depth.maps.numbers == {3: 0, 4: 1, 5: 2}


def test_the_depth_pass_of_a_multi_layer_render_is_a_depth_map(tmp_path: Path) -> None:
    """As docs/compositing.md has it written: all passes in one file, each layer a part of it."""
    work = solved(tmp_path, (1, 2, 3))
    done("save", work, *LENS_OPTIONS, "--method", "features", "--no-copy", "--blend", tmp_path / "a.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    scene = bpy.context.scene
    scene.view_layers[0].use_pass_z = True
    image = scene.render.image_settings
    image.media_type, image.color_depth = "MULTI_LAYER_IMAGE", "32"
    scene.render.filepath = str(tmp_path / "layers" / "a_####")
    bpy.ops.render.render(animation=True)
    scene.virtual_aperture.depth_maps = str(tmp_path / "layers")
    shown = shot_of(scene).depth
    assert shown is not None and shown.maps.frames == (1, 2, 3) and shown.fit.kind == "depth"
    # The mesh of the feature points ends before the border.
    inner = np.s_[10:80, 10:130]
    np.testing.assert_allclose(shown.maps.read(1).values[inner], depth()[inner], rtol=0.02)
    said = done(
        "render", work, *LENS_OPTIONS, "--depth", tmp_path / "layers", "--frames", 1, "--out",
        tmp_path / "out" / "####.png",
    )  # fmt: skip
    assert "rendering 1 frame" in said


def test_cropped_maps_are_refused_and_other_shapes_are_said(tmp_path: Path) -> None:
    work, out = solved(tmp_path, (1, 2, 3)), tmp_path / "out" / "####.png"
    maps = write(tmp_path / "maps", (1, 2, 3))
    for path in maps.iterdir():
        cv2.imwrite(str(path), (1000 * depth()[:, 35:125]).astype(np.uint16))
    ended = here("render", work, *LENS_OPTIONS, "--depth", maps, "--out", out)
    assert ended.returncode == 1 and not out.parent.exists()
    assert "the depth maps are 90x90, the clip is 160x90: they were cropped or padded. Maps of any size" in (
        ended.stderr
    )
    for path in maps.iterdir():
        cv2.imwrite(str(path), cv2.resize((1000 * depth()).astype(np.uint16), (64, 64)))
    said = done("save", work, *LENS_OPTIONS, "--depth", maps, "--no-copy", "--blend", tmp_path / "a.blend")
    assert "note: the depth maps are 64x64, stretched over 160x90; each should show the whole frame" in said
    cv2.imwrite(str(maps / "z_0002.png"), np.ones((32, 64), np.uint16))
    ended = here("render", work, *LENS_OPTIONS, "--depth", maps, "--out", out)
    assert "z_0002.png is 64x32, the first depth map is 64x64; all must have one size" in ended.stderr
    assert "stills" not in ended.stderr
