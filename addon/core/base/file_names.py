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
            f"{str(name)[1:]} is no name that can be used (not UTF-8); rename the file or folder"
        ) from None
    return path
