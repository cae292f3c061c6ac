"""Checks of the names of files and folders."""

import os
from pathlib import Path

from .errors import UserError


def checked_name(path: Path) -> Path:
    """Return the path; raises UserError if it is not UTF-8, which Blender and OpenCV need."""
    name = os.fsencode(path)
    try:
        name.decode()
    except UnicodeDecodeError:
        raise UserError(
            f"{str(name)[1:]} is not a usable name (not UTF-8); rename the file or folder"
        ) from None
    return path


def check_file(path: Path) -> None:
    """Raise UserError if the path exists and is not a file, so that a file cannot replace it."""
    if os.path.lexists(path) and not path.is_file():
        what = "a broken link" if leads_nowhere(path) else "a folder" if path.is_dir() else "not a file"
        raise UserError(f"{path} is {what}; choose another file")


def leads_nowhere(path: Path) -> bool:
    """Return whether a path is a broken link or a link to itself."""
    return path.is_symlink() and not path.exists()
