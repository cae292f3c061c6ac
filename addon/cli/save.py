"""The command that makes a .blend, with all that it needs beside it, to open or to send."""

import argparse
import zipfile
from pathlib import Path

from ..core.base import atomic
from ..core.base.errors import Remedy, UserError
from ..core.base.file_names import check_file
from ..core.base.streams import say
from ..core.depth.user_maps import open_depth
from ..core.media.clip import Footage, FrameRange
from ..core.media.copying import copy_clip, copy_file, copy_pictures
from ..core.media.masks import open_masks
from ..core.media.sequence import clip_files
from ..core.sfm.workspace import load_solve
from ..render.output.output import check_folder, set_still
from ..render.processes.launcher import write_blend
from ..scene.base.paths import absolute
from ..scene.build import move_clip
from ..scene.properties import VirtualApertureSettings
from .lens import movie_frames, say_lens, scene_of, set_lens
from .lens_options import add_lens, check_numbers, has_focus, read_lens
from .options import Commands, UsageError, path

MASKS, DEPTH, APERTURE = "masks", "depth", "aperture"
"""Folders beside the .blend, or within a farm's bundle, for copies of the user's pictures."""
MOST_NAMED = 5
"""Files and folders beside a .blend that are named; of more, the first and the last. Chosen for one line."""


def add_command(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the command `save`, which sets `command` to the function that runs it."""
    one = commands.add_parser(
        "save", parents=[common], help="save the solved clip as a .blend, ready to open or to send"
    )
    one.add_argument("work", type=path, metavar="DIR", help="folder of the solve")
    one.add_argument("--blend", type=path, required=True, metavar="FILE")
    one.add_argument(
        "--pack",
        action="store_true",
        help="also pack the .blend and everything it needs into one file, FILE.zip",
    )
    one.add_argument("--overwrite", action="store_true", help="replace an existing .blend and .zip")
    one.add_argument("--frames", type=FrameRange.parse, metavar="A-B", help="frames it renders")
    one.add_argument(
        "--no-copy", action="store_true", help="refer to the clip, pictures and solve where they are"
    )
    one.add_argument(
        "--lens", type=path, metavar="FILE.json", help="take the lens from a file of a farm's job"
    )
    add_lens(one, required=False)
    one.set_defaults(command=save)


def save(options: argparse.Namespace) -> None:
    """Run `save DIR --blend FILE`: write a .blend, and all of its inputs beside it."""
    blend: Path = options.blend.absolute()
    if blend.suffix.lower() != ".blend":
        raise UserError(f"{blend.name} must end in .blend")
    if options.pack and options.no_copy:
        raise UsageError("--pack copies what the .blend needs, --no-copy does not; see --help")
    packed = blend.with_suffix(".zip")
    for file in (blend, packed) if options.pack else (blend,):
        check_file(file)
        if file.exists() and not options.overwrite:
            raise UserError(f"{file} already exists; choose another file, or overwrite it", Remedy.OVERWRITE)
    check_folder(blend.parent)
    if options.lens is None:
        check_numbers(options)
    else:
        read_lens(options.lens, options)
    solved = load_solve(options.work)
    scene, settings, footage = scene_of(solved)
    frames = movie_frames(footage, options.frames)
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    if has_focus(options):
        set_lens(settings, solved, options, frames)
        say_lens(settings, solved.reconstruction, frames)
    set_still(scene, ".png", footage)
    scene.render.filepath = "//render/"
    atomic.collect_orphans(blend.parent)
    if options.no_copy:
        write_blend(blend)
        say(f"saved {blend}; it reads the clip {footage.path} and the solve in {solved.work_dir}")
        return
    # The whole clip: it is recognised by it.
    clip = copy_clip(footage.whole(), blend.parent)
    pictures = copy_beside(settings, footage, blend.parent)
    move_clip(scene, footage.part(footage.frames, clip))
    # The solve is in the .blend; another machine does not have this folder.
    settings.work_dir = ""
    write_blend(blend)
    parts = [clip, *pictures]
    home = blend.parent.resolve()
    beside = (file for path in parts for file in (_files(path) if path.resolve() == home else [path]))
    named = sorted({path.resolve().relative_to(home).parts[0] for path in beside})
    # A clip's pictures in the .blend's own folder are many.
    names = ", ".join(named if len(named) <= MOST_NAMED else [named[0], "...", named[-1]])
    if options.pack:
        _pack(packed, blend, parts)
        say(f"packed {packed}: {blend.name} with {names}")
    say(f"saved {blend}; send it together with {names} next to it")


def copied(
    folder: Path,
    footage: Footage,
    depth: Path | None,
    masks: Path | None,
    image: Path | None,
    segmenter: Path | None,
) -> tuple[Path | None, ...]:
    """Copy the user's depth maps and masks of a clip, the aperture's picture and the segmenter into a folder.

    Returns:
        The copies; None for missing ones.
    """
    if image is not None:
        copy_file(image, folder / APERTURE / image.name)
    if segmenter is not None:
        copy_file(segmenter, folder / segmenter.name)
    return (
        copy_pictures(open_depth(depth, footage).pictures, folder / DEPTH) if depth is not None else None,
        copy_pictures(open_masks(masks, footage).pictures, folder / MASKS) if masks is not None else None,
        folder / APERTURE / image.name if image is not None else None,
        folder / segmenter.name if segmenter is not None else None,
    )


def copy_beside(settings: VirtualApertureSettings, footage: Footage, folder: Path) -> list[Path]:
    """Copy the user's depth maps, masks, aperture and segmenter into a folder, and set the new paths.

    Returns:
        The new paths.
    """
    held = settings.depth_maps, settings.masks, settings.shape.image, settings.segmenter
    copies = copied(folder, footage, *(absolute(path) if path else None for path in held))
    new = [str(path) if path is not None else "" for path in copies]
    settings.depth_maps, settings.masks, settings.shape.image, settings.segmenter = new
    return [path for path in copies if path is not None]


def _pack(packed: Path, blend: Path, parts: list[Path]) -> None:
    """Write the .blend and other files and folders as one archive, which is one folder inside."""
    with atomic.staged(packed) as part:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
            for file in [blend, *(file for path in parts for file in _files(path))]:
                archive.write(file, Path(blend.stem) / file.resolve().relative_to(blend.parent.resolve()))
        with zipfile.ZipFile(part) as archive:
            if damaged := archive.testzip():
                raise UserError(f"{packed} could not be written completely ({damaged}); is the disk full?")


def _files(path: Path) -> list[Path]:
    """The files that a clip's path stands for: a video, a folder, a pattern."""
    return [path] if path.is_file() else list(clip_files(path))
