"""Reading files with names from users and strangers: only regular files, up to their size.

A pipe waits for its writer, a device such as /dev/zero never ends, and a count or a size within a file can be
any number.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

_KINDS = (
    (stat.S_ISFIFO, "it is a pipe, not a file"),
    (stat.S_ISSOCK, "it is a socket, not a file"),
)
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)


def regular_stat(path: Path) -> os.stat_result:
    """Return the system's information on a regular file without opening it; links are followed.

    Call it before another library opens the path.

    Raises:
        OSError: There is no file, or it is a folder, a pipe, a socket or a device.
    """
    return _checked(path.stat(), path)


def open_regular(path: Path) -> BinaryIO:
    """A regular file to read bytes from; OSError as `regular_stat`, at once even for a pipe."""
    # Tested before it is opened, as opening acts on some devices, and again afterwards.
    regular_stat(path)
    file = os.open(path, _FLAGS)
    try:
        _checked(os.fstat(file), path)
        return os.fdopen(file, "rb")
    except BaseException:
        os.close(file)
        raise


def read_regular(path: Path, most: int | None = None) -> bytes:
    """All bytes of a regular file, as many as it has when it is opened.

    OSError as `regular_stat`, and before anything is read where they are more than `most`.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        if most is not None and size > most:
            raise OSError(errno.EFBIG, f"it has {size} bytes, {most} at most were expected", str(path))
        return file.read(size)


def is_regular(path: Path) -> bool:
    """Return whether a path leads to a readable regular file."""
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
