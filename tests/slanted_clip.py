"""The clip of the slanted plane: in Blender ready to be rendered, and as files with a solve."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.render.output import output
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus

from .scenes import LENS, slanted_plane, slanted_shot, texture

FRAMES = [1, 2, 3]
LENS_OPTIONS = ("--focus-point", 3, 9, 30, "--method", "features", "--views", 4)


@pytest.fixture
def ready(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    """A scene with the clip, in which nothing but *Render* is left to be pressed."""
    made = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, made.footage, made.reconstruction)
    set_focus(settings, Focus(points=(3, 9, 30, 60)), 1)
    settings.views, settings.method = 4, "features"
    return scene


def rendered(scene: bpy.types.Scene, out: Path, overwrite: bool = False) -> list[str]:
    """Render `FRAMES`; what was said."""
    said: list[str] = []
    output.render_sequence(scene, FRAMES, out, overwrite, said.append)
    return said


def listed(folder: Path) -> dict[str, bytes]:
    """Contents of the files of a folder by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def video(path: Path, seed: int = 0) -> Path:
    """Three frames that are those of another clip with another seed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (LENS.width, LENS.height))
    for number in range(3):
        writer.write(np.roll(texture(LENS.width, LENS.height, seed), number, axis=1))
    writer.release()
    return path


def keep(clip: Path, work: Path, camera: Intrinsics = LENS, again: bool = False) -> None:
    """Keep the truth as the imported solve of a clip of the slanted plane."""
    keep_import(Imported(slanted_plane(camera), "COLMAP text", ()), open_footage(clip), work, again)
