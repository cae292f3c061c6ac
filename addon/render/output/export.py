"""Files of a solved clip for other programs: its frames in two layers, and its lens as STMaps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import bpy

from ...core.base.arrays import Map
from ...core.base.atomic import collect_orphans, staged
from ...core.base.errors import Remedy, UserError
from ...core.base.file_names import check_file
from ...core.base.time_left import Clock
from ...core.camera import stmap
from ...core.camera.canvas import Canvas
from ...core.frame.two_layers import two_layers
from ...core.media.exr_file import write_exr
from ...scene.base.timeline import go_to
from ...scene.lens.lens import frame_options
from ...scene.sources.shot import shot_of
from .output import check_folder, numbered

LAYERS, STMAPS = "layers", "stmap"
WHAT = {
    LAYERS: ("Two-Layer EXR", "Each sharp frame and what it hides, both with alpha and depth"),
    STMAPS: ("STMaps", "The lens distortion, as maps that undistort frames and distort them again"),
}
"""Kinds of exports by their name on the command line: label and description."""
Channels = Mapping[str, Map]


@dataclass(frozen=True)
class Exported:
    """A file that is to be written."""

    file: Path
    channels: Callable[[], Channels]
    """Returns its channels (H, W) by name; errors as of `two_layers` and `Canvas.pinhole`."""
    frame: int | None = None
    """Frame of the clip; None for a file of all exported frames."""


def planned(scene: bpy.types.Scene, what: str, frames: Sequence[int], folder: Path) -> list[Exported]:
    """Return the files that an export of a scene's frames into a folder will write.

    A lens that stays the same has one pair of STMaps.
    """
    return (_layers if what == LAYERS else _stmaps)(scene, frames, folder)


def check_free(files: Sequence[Exported], overwrite: bool) -> None:
    """Check that files can be written and do not exist, before any work.

    Raises:
        UserError: One exists, or cannot be written.
    """
    for each in files:
        check_file(each.file)
        if each.file.exists() and not overwrite:
            raise UserError(
                f"{each.file} already exists; choose another folder, or overwrite it", Remedy.OVERWRITE
            )
        check_folder(each.file.parent)


def write(files: Sequence[Exported], report: Callable[[str], None]) -> None:
    """Write files, each complete or not there; passes checkpoints.

    Raises:
        UserError: A file or frame, which is named, fails.
    """
    collect_orphans(files[0].file.parent)
    clock = Clock("export", len(files), report)
    for each in files:
        channels = each.channels()
        with staged(each.file) as part:
            write_exr(part, channels)
        clock.tick(each.frame, each.file.name)


def _layers(scene: bpy.types.Scene, frames: Sequence[int], folder: Path) -> list[Exported]:
    shot = shot_of(scene)

    def channels(frame: int) -> Channels:
        # The focus may be keyed.
        go_to(scene, frame)
        options = frame_options(scene.virtual_aperture, shot.reconstruction)
        return two_layers(shot.context, frame, options, shot.size(frame)).channels()

    return [
        Exported(folder / numbered("layers_####.exr", each), partial(channels, each), each) for each in frames
    ]


def _stmaps(scene: bpy.types.Scene, frames: Sequence[int], folder: Path) -> list[Exported]:
    context = shot_of(scene).context
    canvases = {each: context.canvas(each) for each in frames}
    stays = len(set(canvases.values())) == 1

    def channels(made: Callable[[Canvas], Map], frame: int) -> Channels:
        return stmap.channels(made(canvases[frame]))

    return [
        Exported(
            folder / (f"{name}.exr" if stays else numbered(f"{name}_####.exr", frame)),
            partial(channels, made, frame), None if stays else frame,
        )
        for frame in frames[: 1 if stays else None]
        for name, made in (("undistort", stmap.undistort_map), ("redistort", stmap.redistort_map))
    ]  # fmt: skip
