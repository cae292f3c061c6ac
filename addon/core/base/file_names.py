"""Names of files and folders that every library of ours can take."""

from __future__ import annotations

import os
from pathlib import Path

from .errors import UserError


def checked_name(path: Path) -> Path:
    """The path itself; UserError where it is not UTF-8, which Blender and OpenCV cannot open."""
    name = os.fsencode(path)
    try:
        name.decode()
    except UnicodeDecodeError:
        raise UserError(
            f"{str(name)[1:]} is not a usable name (not UTF-8); rename the file or folder"
        ) from None
    return path


def check_file(path: Path) -> None:
    """UserError for a place where something lies that is no file, and so cannot be replaced by one."""
    if os.path.lexists(path) and not path.is_file():
        what = "a broken link" if leads_nowhere(path) else "a folder" if path.is_dir() else "not a file"
        raise UserError(f"{path} is {what}; choose another file")


def leads_nowhere(path: Path) -> bool:
    """Return whether a path is a link to a missing file, or to itself."""
    return path.is_symlink() and not path.exists()
