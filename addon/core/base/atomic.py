"""Files that are whole or not there: written under a name of their own beside, and then moved into place.

What is unfinished is named after the process that writes it, so that two never share a name, and what a
process left that was killed is known and collected.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import UserError

PART = ".part-"
"""Begins the name of an unfinished file, or folder, beside its place."""
TEMPORARY = "virtual-aperture-"
"""Begins the name of a folder in the system's folder for temporary files."""
_OWNED = re.compile(r"(?P<host>.+)-(?P<pid>\d+)-[0-9a-f]{8}(-.+)?")
ABANDONED = 24 * 3600
"""Seconds after which an unfinished file of another machine, whose processes cannot be asked, is taken for
abandoned: by then a farm has given up a frame."""


def owned_name(prefix: str) -> str:
    """A name that nobody else has, and that tells this machine and process."""
    return f"{prefix}{_host()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """A path beside `path` to write to; what lies there at the end is moved into place, durably.

    Its name is this process's own, so that two that write the same file never share one. If anything is
    raised within, or nothing was written, nothing is left. Raises UserError where the file cannot be written.
    """
    part = path.with_name(f"{owned_name(PART)}-{path.name}")
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
    sync(part)
    part.replace(path)
    if os.name == "posix":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def sync(path: Path) -> None:
    """Return when a file's contents are on the disk. Raises OSError."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a small file, whole or not at all. Raises UserError."""
    with staged(path) as part:
        part.write_bytes(data)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for temporary files, gone at the end; a killed process's by `collect_temporary`."""
    folder = Path(tempfile.gettempdir()) / owned_name(TEMPORARY)
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def collect_temporary() -> list[Path]:
    """Remove the temporary folders that dead processes of ours left; which ones."""
    return collect_orphans(Path(tempfile.gettempdir()), TEMPORARY)


def collect_orphans(folder: Path, prefix: str = PART) -> list[Path]:
    """Remove the unfinished files and folders that dead processes left in a folder; which ones."""
    removed = []
    for path in orphans(folder, prefix):
        with contextlib.suppress(OSError):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()
            removed.append(path)
    return removed


def orphans(folder: Path, prefix: str) -> list[Path]:
    """What dead processes left in a folder under names by `owned_name`; none where it cannot be listed."""
    found = []
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            match = _OWNED.fullmatch(path.name.removeprefix(prefix)) if path.name.startswith(prefix) else None
            if match is not None and _is_abandoned(path, match["host"], int(match["pid"])):
                found.append(path)
    return found


def _is_abandoned(path: Path, host: str, pid: int) -> bool:
    if host == _host():
        return pid != os.getpid() and not is_alive(pid)
    try:
        return time.time() - path.stat().st_mtime > ABANDONED
    except OSError:
        return False


def is_alive(pid: int) -> bool:
    """Whether a process of this machine runs."""
    if os.name != "posix":
        # Windows cannot delete a file that is open: trying to is the question.
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    # One that has ended, and that whoever started it has not asked about, still has its number.
    with contextlib.suppress(OSError, IndexError):
        return Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0] != "Z"
    return True


def _host() -> str:
    return re.sub(r"[^A-Za-z0-9]+", "_", socket.gethostname()) or "host"
