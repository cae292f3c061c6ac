"""Paths on the command line."""

from __future__ import annotations

import os
from pathlib import Path

from ..core.base.errors import UserError
from ..core.base.file_names import checked_name


def path(text: str) -> Path:
    """Return a path as it was typed; UserError for one that is empty or not UTF-8.

    Two slashes in front are one, as everywhere but in Blender, to which they mean the folder of the .blend.
    """
    if not text:
        # Python takes it for the current folder.
        raise UserError("a file or folder name is empty")
    if os.name == "posix" and text.startswith("//"):
        text = "/" + text.lstrip("/")
    checked_name(Path(text).absolute())
    return Path(text)
