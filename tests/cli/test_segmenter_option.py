"""A segmenter of the user's own on the command line."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.scene.sources.shot import shot_of

from ..command_line import done, here
from ..onnx_files import ANY, red
from ..scenes import LENS, slanted_plane, write_plane

LENS_OPTIONS = ("--focus-distance", 8, "--blur", 0.03, "--views", 4)
FRAMES = tuple(range(1, 9))

pytestmark = pytest.mark.usefixtures("registered")


def test_a_segmenter_goes_with_the_blend_and_another_file_is_refused(tmp_path: Path) -> None:
    work, own = tmp_path / "work", tmp_path / "own" / "net.onnx"
    solved = slanted_plane(LENS, FRAMES)
    keep_import(
        Imported(solved, "COLMAP text", ()), open_footage(write_plane(tmp_path / "clip", solved)), work
    )
    own.parent.mkdir()
    own.write_bytes(red(ANY, times=-40.0))
    ended = here("render", work, *LENS_OPTIONS, "--segmenter", own, "--out", tmp_path / "out" / "####.png")
    assert ended.returncode == 1 and not (tmp_path / "out").exists()
    assert "segmenter: net.onnx does not find the disc of a test picture" in ended.stderr
    own.write_bytes(red())
    (tmp_path / "sent").mkdir()
    done("save", work, *LENS_OPTIONS, "--segmenter", own, "--blend", tmp_path / "sent" / "scene.blend")
    own.unlink()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "sent" / "scene.blend"))
    scene = bpy.context.scene
    assert scene.virtual_aperture.segmenter == "//net.onnx"
    networks = shot_of(scene).networks
    assert networks.segmenter is not None
