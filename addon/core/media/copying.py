"""Copies of clips and pictures, so that a folder holds all that it needs."""

import shutil
from pathlib import Path

from ..base import atomic
from ..base.digest import file_digest
from ..base.errors import UserError
from ..base.regular_file import is_regular
from .clip import Footage


def copy_file(source: Path, target: Path) -> None:
    """Copy a file completely or not; nothing is done if the same file is there already.

    Raises:
        UserError: Another file is there, or it cannot be written.
    """
    if target.exists():
        if not target.samefile(source) and file_digest(target) != file_digest(source):
            raise UserError(f"{target} already exists and differs from {source}; choose another folder")
        return
    if not is_regular(source):
        raise UserError(f"{source} cannot be copied: it is not a file, or is missing")
    with atomic.staged(target) as part:
        shutil.copyfile(source, part)
        if part.stat().st_size != source.stat().st_size:
            raise UserError(f"{source} could not be copied completely to {target}; is the disk full?")


def copy_pictures(footage: Footage, home: Path) -> Path:
    """Copy the files of a clip, of masks or of depth maps into a folder of their own; their path there.

    The path is the folder, or a pattern or video in it, as that of the original is.
    """
    if home.is_dir():
        atomic.collect_orphans(home)
    for file in footage.files or (footage.path,):
        copy_file(file, home / file.name)
    return home if footage.path.is_dir() else home / footage.path.name


def copy_clip(footage: Footage, folder: Path) -> Path:
    """Copy a clip into a folder unless it lies in it or below; its path there.

    A video lies in the folder itself, pictures in one named after theirs.
    """
    if footage.path.resolve().is_relative_to(folder.resolve()):
        return footage.path
    home = folder if footage.is_video else folder / f"{footage.files[0].parent.name}_frames"
    return copy_pictures(footage, home)
