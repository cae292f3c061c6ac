"""The sample clip, solved and opened as a scene, for pictures of the documentation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

import addon
from addon.cli.main import run_command

from .demo import ROOT


@contextmanager
def opened_desk(work: Path | None, lens: Sequence[str], frame: int) -> Iterator[tuple[bpy.types.Scene, Path]]:
    """Open the solved clip with options of a lens at a frame, and yield the scene and a folder.

    The folder `work` keeps the solve for the next time. SystemExit if a command fails.
    """
    addon.register()
    with tempfile.TemporaryDirectory() as made:
        folder = work or Path(made)
        solved, blend = folder / "desk.aperture", folder / "desk.blend"
        if not solved.exists():
            _run("solve", ROOT / "sample_scenes" / "desk.mp4", "--work", solved)
        blend.unlink(missing_ok=True)
        _run("save", solved, *lens, "--no-copy", "--blend", blend)
        bpy.ops.wm.open_mainfile(filepath=str(blend))
        scene = bpy.context.scene
        scene.frame_set(frame)
        scene.render.image_settings.file_format = "PNG"
        yield scene, folder


def rendered(scene: bpy.types.Scene, file: Path) -> NDArray[np.uint8]:
    """Render the scene into a file; the picture (h, w, 3), BGR."""
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    picture = cv2.imread(str(file))
    assert picture is not None
    return np.asarray(picture, np.uint8)


def _run(*words: object) -> None:
    if run_command([str(word) for word in words]):
        raise SystemExit(1)
