"""Files that are whole or not there: written under a name of their own beside, and then moved into place."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import UserError

_PART = re.compile(r"\.part-(?P<host>.+)-(?P<pid>\d+)-[0-9a-f]{8}-.+")
ABANDONED = 24 * 3600
"""Seconds after which an unfinished file of another machine, whose processes cannot be asked, is taken for
abandoned: by then a farm has given up a frame."""


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to; what lies there at the end is moved into place, durably.

    Its name is this process's own, so that two that write the same file never share one. If anything is
    raised within, or nothing was written, nothing is left. Raises UserError where the file cannot be written.
    """
    part = path.with_name(f".part-{_host()}-{os.getpid()}-{uuid.uuid4().hex[:8]}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        publish(part, path)
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def publish(part: Path, path: Path) -> None:
    """Move a file that was written into its place once it is on the disk. Raises OSError."""
    with part.open("rb") as file:
        os.fsync(file.fileno())
    part.replace(path)
    if os.name == "posix":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a small file, whole or not at all. Raises UserError."""
    with staged(path) as part:
        part.write_bytes(data)


def collect_orphans(folder: Path) -> list[Path]:
    """Remove the unfinished files that dead processes left in a folder; which ones."""
    removed = []
    for path in folder.glob(".part-*"):
        match = _PART.fullmatch(path.name)
        if match is None or not _is_abandoned(path, match["host"], int(match["pid"])):
            continue
        with contextlib.suppress(OSError):
            path.unlink()
            removed.append(path)
    return removed


def _is_abandoned(path: Path, host: str, pid: int) -> bool:
    if host == _host():
        return pid != os.getpid() and not _is_alive(pid)
    try:
        return time.time() - path.stat().st_mtime > ABANDONED
    except OSError:
        return False


def _is_alive(pid: int) -> bool:
    if os.name != "posix":
        # Windows cannot delete a file that is open: trying to is the question.
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _host() -> str:
    return re.sub(r"[^A-Za-z0-9]+", "_", socket.gethostname()) or "host"
