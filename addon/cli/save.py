"""The command that makes a .blend, with all that it needs beside it, to open or to send."""

from __future__ import annotations

import argparse
import zipfile
from pathlib import Path

import bpy

from ..core.base import atomic
from ..core.base.errors import Remedy, UserError
from ..core.base.file_names import check_file
from ..core.base.streams import say
from ..core.depth.user_maps import open_depth
from ..core.media.clip import Footage, open_footage
from ..core.media.copying import copy_clip, copy_file, copy_pictures
from ..core.media.masks import open_masks
from ..core.sfm.workspace import load_solve
from ..render.output import check_folder, set_still
from ..render.quiet import quiet
from ..scene.build import move_clip
from ..scene.paths import absolute
from ..scene.properties import VirtualApertureSettings
from .aperture import FOLDER as APERTURE
from .lens import add_lens, check_numbers, has_focus, say_lens, scene_of, set_lens
from .paths import path

MASKS, DEPTH = "masks", "depth"
"""Folders beside the .blend, or within a farm's bundle, for copies of the user's pictures."""

MOST_NAMED = 5
"""Of files and folders beside a .blend; of more the first and the last are told. By eye: a line."""
ENDS = b"ENDB", b"\xb1\xea\x92\x8f"
"""What ends a .blend: its last block, or, where it is compressed, the number of Zstandard's seek table."""


def add_command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], common: argparse.ArgumentParser
) -> None:
    """`save`, which sets `command` to the function that runs it."""
    one = commands.add_parser(
        "save", parents=[common], help="save the solved clip as a .blend, ready to open or to send"
    )
    one.add_argument("work", type=path, metavar="DIR", help="folder that keeps the solve")
    one.add_argument("--blend", type=path, required=True, metavar="FILE")
    one.add_argument(
        "--pack", action="store_true", help="also write the .blend and all it needs as one file, FILE.zip"
    )
    one.add_argument(
        "--overwrite", action="store_true", help="replace the .blend, and the .zip, if it exists"
    )
    add_lens(one, required=False)
    one.set_defaults(command=save)


def save(options: argparse.Namespace) -> None:
    """`save DIR --blend FILE`: the .blend, and beside it all that it needs: the folder is all there is."""
    blend: Path = options.blend.absolute()
    if blend.suffix.lower() != ".blend":
        raise UserError(f"{blend.name} must end in .blend")
    packed = blend.with_suffix(".zip")
    for file in (blend, packed) if options.pack else (blend,):
        check_file(file)
        if file.exists() and not options.overwrite:
            raise UserError(f"{file} exists; name another file, or overwrite it", Remedy.OVERWRITE)
    check_folder(blend.parent)
    check_numbers(options)
    solved = load_solve(options.work)
    scene, settings, footage = scene_of(solved)
    if has_focus(options):
        set_lens(settings, solved, options)
        say_lens(settings, solved.reconstruction)
    set_still(scene, ".png", footage)
    atomic.collect_orphans(blend.parent)
    # The whole clip: it is recognised by it.
    clip = copy_clip(open_footage(footage.path), blend.parent)
    pictures = copy_beside(settings, footage, blend.parent)
    move_clip(scene, open_footage(clip, footage.frames))
    # The solve is in the .blend; another machine does not have this folder.
    settings.work_dir = ""
    scene.render.filepath = "//render/"
    _write(blend)
    parts = [clip, *pictures]
    home = blend.parent.resolve()
    beside = (file for path in parts for file in (_files(path) if _real(path) == home else [path]))
    named = sorted({_real(path).relative_to(home).parts[0] for path in beside})
    # A clip's pictures in the .blend's own folder are many.
    names = ", ".join(named if len(named) <= MOST_NAMED else [named[0], "...", named[-1]])
    if options.pack:
        _pack(packed, blend, parts)
        say(f"packed {packed}: {blend.name} with {names}")
    say(f"saved {blend}; send it together with {names} beside it")


def copy_beside(settings: VirtualApertureSettings, footage: Footage, folder: Path) -> list[Path]:
    """Copy the user's depth maps and masks into a folder and let the settings lead there; their new paths."""
    copies = []
    if settings.depth_maps:
        maps = open_depth(Path(settings.depth_maps), footage).maps
        copies.append(copy_pictures(maps, folder / DEPTH))
        settings.depth_maps = str(copies[-1])
    if settings.masks:
        pictures = open_masks(Path(settings.masks), footage).pictures
        copies.append(copy_pictures(pictures, folder / MASKS))
        settings.masks = str(copies[-1])
    if settings.shape.image:
        picture = absolute(settings.shape.image)
        copies.append(folder / APERTURE / picture.name)
        copy_file(picture, copies[-1])
        settings.shape.image = str(copies[-1])
    return copies


def _write(blend: Path) -> None:
    with atomic.staged(blend) as part:
        try:
            with quiet(1):
                bpy.ops.wm.save_as_mainfile(filepath=str(part), check_existing=False)
        except RuntimeError as error:
            raise UserError(f"{blend} cannot be written: {str(error).strip()}") from None
        finally:
            part.with_name(part.name + "1").unlink(missing_ok=True)
        # Blender does not always notice that it could not write on.
        if not any(end in part.read_bytes()[-64:] for end in ENDS):
            raise UserError(f"{blend} could not be written as a whole; is the disk full?")


def _pack(packed: Path, blend: Path, parts: list[Path]) -> None:
    """Write the .blend and other files and folders as one archive, which is one folder inside."""
    with atomic.staged(packed) as part:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_STORED) as archive:
            for file in [blend, *(file for path in parts for file in _files(path))]:
                archive.write(file, Path(blend.stem) / _real(file).relative_to(blend.parent.resolve()))
        with zipfile.ZipFile(part) as archive:
            if damaged := archive.testzip():
                raise UserError(f"{packed} could not be written as a whole ({damaged}); is the disk full?")


def _files(path: Path) -> list[Path]:
    """The files that a clip's path stands for: a video, a folder, a pattern."""
    return [path] if path.is_file() else list(open_footage(path).files)


def _real(path: Path) -> Path:
    return path.resolve()
