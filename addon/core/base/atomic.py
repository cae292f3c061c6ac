"""Atomic files: written under a temporary name beside their place, and then moved.

A temporary name is unique and has a lock beside it that ends with the process. Remains of a killed process
are therefore recognised and removed, and the work of another machine is not.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import UserError
from .file_lock import FileLock, is_abandoned
from .processes import process_table

PART = ".part-"
"""Begins the name of an unfinished file, or folder, beside its place."""
TEMPORARY = "virtual-aperture-"
"""Begins the name of a folder in the system's folder for temporary files."""
LOCK = ".lock"
"""Suffix of the lock file beside a temporary name."""
_OWNED = re.compile(r"(?P<name>(?P<table>[0-9a-f]{12})-(?P<pid>\d+)-[0-9a-f]{8})(-.+|\.lock)?")


def owned_name(prefix: str) -> str:
    """Return a unique name that identifies this process and its table."""
    return f"{prefix}{process_table()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"


@contextmanager
def owned(folder: Path, prefix: str) -> Iterator[str]:
    """Yield a name for unfinished work in a folder, to be followed by "-" and more.

    While it lasts, `collect_orphans` of any process leaves it alone.

    Raises:
        OSError: Nothing can be written there.
    """
    name = owned_name(prefix)
    with FileLock(folder / f"{name}{LOCK}", UserError):
        yield name


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to; at the end it is moved into place, durably.

    Processes that write the same file never share a name. After an error, or without output, nothing is left.

    Raises:
        UserError: The file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with owned(path.parent, PART) as name:
            part = path.with_name(f"{name}-{path.name}")
            try:
                yield part
                publish(part, path)
            finally:
                with contextlib.suppress(OSError):
                    part.unlink(missing_ok=True)
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror or error}") from error


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
    """Write a small file atomically.

    Raises:
        UserError: It cannot be written.
    """
    with staged(path) as part:
        part.write_bytes(data)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for temporary files, gone at the end; a killed process's by `collect_temporary`."""
    temporary = place_of_temporary()
    with owned(temporary, TEMPORARY) as name:
        folder = temporary / name
        folder.mkdir(mode=0o700)
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def collect_temporary() -> list[Path]:
    """Remove the temporary folders that dead processes of ours left; which ones."""
    return collect_orphans(place_of_temporary(), TEMPORARY)


def place_of_temporary() -> Path:
    """The folder that holds temporary ones; UserError where none can be written."""
    try:
        return Path(tempfile.gettempdir())
    except OSError:
        raise UserError(
            "no folder for temporary files can be written; free some space, or name another by TMPDIR"
        ) from None


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


def orphans(folder: Path, prefix: str, lock: Path | None = None) -> list[Path]:
    """Return the remains of dead processes in a folder, under names by `owned_name`, the locks last.

    There are none if the folder cannot be listed, or if the processes may be alive.

    Args:
        folder: The folder.
        prefix: Prefix of the names.
        lock: The lock file of all names, instead of one beside each.
    """
    found = []
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            match = _OWNED.fullmatch(path.name.removeprefix(prefix)) if path.name.startswith(prefix) else None
            if match is not None:
                held = lock or folder / f"{prefix}{match['name']}{LOCK}"
                if is_abandoned(held, match["table"], int(match["pid"])):
                    found.append(path)
    return sorted(found, key=lambda path: path.name.endswith(LOCK))
