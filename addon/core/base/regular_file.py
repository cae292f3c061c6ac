"""Reading of regular files whose names come from users.

Pipes wait for a writer, devices such as /dev/zero never end, and a size within a file can be any number.
"""

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any, BinaryIO

_KINDS = ((stat.S_ISFIFO, "it is a pipe, not a file"), (stat.S_ISSOCK, "it is a socket, not a file"))
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


def regular_stat(path: Path) -> os.stat_result:
    """Return the state of a regular file, before another library opens it; follows links.

    Raises OSError for a missing file, folder, pipe, socket or device.
    """
    return _checked(path.stat(), path)


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file to read bytes; raises OSError like `regular_stat`, at once even for a pipe."""
    # Checked before opening, because some devices act when opened, and again afterwards.
    regular_stat(path)
    file = os.open(path, _FLAGS)
    try:
        _checked(os.fstat(file), path)
        return os.fdopen(file, "rb")
    except BaseException:
        os.close(file)
        raise


def read_regular(path: Path, most: int | None = None) -> bytes:
    """Read all bytes of a regular file, as of its opening; raises OSError, also beyond `most` bytes."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if most is not None and size > most:
            raise OSError(errno.EFBIG, f"it has {size} bytes, {most} at most were expected", str(path))
        return file.read(size)


def read_object(path: Path, most: int | None = None) -> dict[str, Any]:
    """Return the object in a JSON file of at most `most` bytes; empty if there is none."""
    try:
        held = json.loads(read_regular(path, most))
    except (OSError, ValueError, RecursionError):
        return {}
    return held if isinstance(held, dict) else {}


def is_regular(path: Path) -> bool:
    """Return whether a path leads to a regular file that can be accessed."""
    try:
        regular_stat(path)
    except (OSError, ValueError):
        return False
    return True


def _checked(state: os.stat_result, path: Path) -> os.stat_result:
    if stat.S_ISDIR(state.st_mode):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(state.st_mode):
        kind = next(
            (name for is_kind, name in _KINDS if is_kind(state.st_mode)), "it is a device, not a file"
        )
        raise OSError(errno.EINVAL, kind, str(path))
    return state
