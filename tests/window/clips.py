"""Scenes to render: made in code, small, so that many renders take little time."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Intrinsics, Reconstruction
from addon.core.media.clip import Footage
from addon.core.media.light import decode_srgb
from addon.core.sfm.workspace import load_solve

from ..media.colour_curves import Recorded, write_clip
from ..scenes import slanted_plane, texture

SMALL = (160, 90)
FRAMES = (1, 2, 3, 4, 5)
VIEWS = 192
"""So many that drawing them takes several turns of the main thread."""


def write_scene(
    folder: Path,
    size: tuple[int, int] = SMALL,
    views: int = VIEWS,
    frames: Sequence[int] = FRAMES,
    space: Recorded | None = None,
) -> Path:
    """A .blend with a solved clip of these frames, in focus at a distance, our engine and EXR output; the
    clip beside it, as files, or a video of 10 bits in a space, with light over white."""
    width, height = size
    import bpy

    from addon.core.media.clip import open_footage
    from addon.scene.build import build

    camera = Intrinsics(width, height, 0.95 * width, 0.95 * width, width / 2, height / 2)
    clip = folder / ("clip" if space is None else "clip.mov")
    (clip if space is None else folder).mkdir(parents=True)
    solve = slanted_plane(camera, frames)
    if space is not None:
        write_clip(clip, [light_of(_seen(solve, image)) for image in solve.images], space)
    for image in solve.images if space is None else ():
        cv2.imwrite(str(clip / f"clip_{image.frame:04d}.png"), _seen(solve, image)[..., ::-1])
    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    scene = bpy.context.scene
    # The camera stands in it.
    bpy.data.objects["Cube"].hide_render = True
    settings = build(scene, open_footage(clip), solve)
    settings.focus_distance = 6.0
    settings.use_auto_views, settings.views = False, views
    scene.render.filepath = "//frames/####"
    output = scene.render.image_settings
    output.file_format, output.color_mode, output.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.footage = f"//{clip.name}"
    blend = folder / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend


def solved_scene(footage: Footage, solve: Reconstruction) -> Any:
    """Settings of a new file whose scene holds a solved clip and nothing else that is seen."""
    import bpy

    from addon.scene.build import build

    bpy.ops.wm.read_homefile(app_template="", use_factory_startup=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    return build(bpy.context.scene, footage, solve)


def saved(folder: Path) -> Path:
    """Save the file that is open."""
    import bpy

    blend = folder / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return blend


def write_desk(
    folder: Path,
    desk: Path,
    work: Path,
    change: Callable[[Any, Reconstruction], object] = lambda settings, solve: None,
) -> Path:
    """A .blend of the sample clip, which lies beside it, and its solve; `change` may change its settings."""
    folder.mkdir()
    solved = load_solve(work, Path(shutil.copy(desk, folder)))
    settings = solved_scene(solved.open_clip(solved.frames), solved.reconstruction)
    settings.footage = "//desk.mp4"
    change(settings, solved.reconstruction)
    return saved(folder)


def light_of(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    """(H, W, 3) linear light of a picture as displayed, up to six times white where it is bright."""
    shown = picture / 255
    return np.asarray(decode_srgb(shown) * (1 + 5 * np.clip(4 * shown - 3, 0, 1)))


def _seen(solve: Reconstruction, image: Image) -> NDArray[np.uint8]:
    """(H, W, 3) RGB: the textured plane of the solve's points as a camera sees it; the first one sees the
    texture."""
    intrinsics = solve.cameras[0]
    xyz = solve.points.xyz
    normal = np.linalg.lstsq(xyz, np.ones(len(xyz)), rcond=None)[0]
    camera = np.array(
        [[intrinsics.fx, 0.0, intrinsics.cx], [0.0, intrinsics.fy, intrinsics.cy], [0.0, 0.0, 1.0]]
    )
    turn = image.rotation + np.outer(image.translation, normal)
    warp = camera @ turn @ np.linalg.inv(camera)
    picture = texture(intrinsics.width, intrinsics.height)
    seen = cv2.warpPerspective(
        picture, warp, (intrinsics.width, intrinsics.height), borderMode=cv2.BORDER_REFLECT
    )
    return seen.astype(np.uint8)


def read_exr(file: Path) -> NDArray[np.float32]:
    """(H, W, 4) float32, top row first."""
    import bpy  # noqa: F401  it brings the module that decodes

    from addon.scene.base.exr import read

    return read(file)
