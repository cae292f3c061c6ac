"""Checks of the names of files and folders."""

import os
from pathlib import Path

from .errors import UserError


def checked_name(path: Path) -> Path:
    """Return the path; raises UserError, as `check_name` does, also where it leads through links."""
    check_name(path)
    check_name(Path(os.path.realpath(path)))
    return path


def check_name(path: Path) -> None:
    """Raise UserError if Blender cannot use a path by its text.

    Blender and OpenCV need UTF-8. Blender takes each backslash for a separator of folders on all systems, for
    the sake of files from Windows (`BLI_path_abs`).
    """
    name = os.fsencode(path)
    try:
        name.decode()
    except UnicodeDecodeError:
        raise UserError(
            f"{str(name)[1:]} is not a usable name (not UTF-8); rename the file or folder"
        ) from None
    if os.sep != "\\" and "\\" in str(path):
        raise UserError(
            f"{path} has a backslash in a name, which Blender reads as a separator of folders; rename the"
            " file or folder"
        )


def check_file(path: Path) -> None:
    """Raise UserError if a file cannot be at a path: by its name, or as something else is there."""
    checked_name(path.absolute())
    if os.path.lexists(path) and not path.is_file():
        what = "a broken link" if leads_nowhere(path) else "a folder" if path.is_dir() else "not a file"
        raise UserError(f"{path} is {what}; choose another file")


def leads_nowhere(path: Path) -> bool:
    """Return whether a path is a broken link or a link to itself."""
    return path.is_symlink() and not path.exists()
