"""Scenes to render: made in code, small, so that many renders take little time."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.reconstruction import Intrinsics

from ..scenes import slanted_plane, texture

WIDTH, HEIGHT = 160, 90
FRAMES = (1, 2, 3, 4, 5)
VIEWS = 192
"""So many that drawing them takes several turns of the main thread: what is kept from one to the next was lost."""


def write_scene(folder: Path) -> Path:
    """A .blend with a solved clip of five frames, in focus at a distance, our engine and EXR output; the clip
    beside it."""
    import bpy

    from addon.core.footage import open_footage
    from addon.scene.build import build

    lens = Intrinsics(WIDTH, HEIGHT, 150.0, 150.0, WIDTH / 2, HEIGHT / 2)
    clip = folder / "clip"
    clip.mkdir(parents=True)
    for frame in FRAMES:
        # Each frame another, so that a frame that was not drawn anew is seen.
        picture = np.roll(texture(WIDTH, HEIGHT), 3 * frame, axis=1)
        cv2.imwrite(str(clip / f"clip_{frame:04d}.png"), picture[..., ::-1])
    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    scene = bpy.context.scene
    settings = build(scene, open_footage(clip), slanted_plane(lens, FRAMES))
    settings.focus_distance = 6.0
    settings.views = VIEWS
    scene.render.filepath = "//frames/####"
    output = scene.render.image_settings
    output.file_format, output.color_mode, output.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.footage = "//clip"
    blend = folder / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend


def read_exr(file: Path) -> NDArray[np.float32]:
    """(H, W, 4) float32, top row first."""
    from addon.scene.exr import read

    return read(file)
