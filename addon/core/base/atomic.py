"""Atomic writing: files are written under a unique name beside their place, then moved into it.

Each unfinished file has a lock beside it that ends with its process. So the files of killed processes can be
collected, and files that another machine is writing are left alone.
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
from .file_names import checked_name

PART = ".part-"
"""Prefix of an unfinished file or folder beside its place."""
TEMPORARY = "virtual-aperture-"
"""Prefix of a folder in the system's folder for temporary files."""
LOCK = ".lock"
"""Suffix of the lock file beside a name by `owned_name`."""
_OWNED = re.compile(r"(?P<name>[0-9a-f]{12}(-\d+)?-[0-9a-f]{8})(-.+|\.lock)?")
"""Names without their prefix; version 1.0 had the process's number in them."""


def owned_name(prefix: str) -> str:
    """Return a unique name."""
    return f"{prefix}{uuid.uuid4().hex[:12]}-{uuid.uuid4().hex[:8]}"


@contextmanager
def owned(folder: Path, prefix: str) -> Iterator[str]:
    """Yield a unique prefix of an unfinished file's name, which `collect_orphans` spares; raises OSError."""
    name = owned_name(prefix)
    with FileLock(folder / f"{name}{LOCK}", UserError):
        yield name


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """Yield a path beside `path` to write to, and move the file there into place at the end, durably.

    Each process has its own path. If an error is raised or nothing is written, no file is left. Raises
    UserError if the file cannot be written.
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


@contextmanager
def staged_folder(folder: Path) -> Iterator[Path]:
    """Yield a new folder beside `folder`, and move it there at the end; after an error it is removed.

    Raises OSError.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    collect_orphans(folder.parent)
    with owned(folder.parent, PART) as name:
        part = folder.with_name(f"{name}-{folder.name}")
        try:
            part.mkdir()
            yield part
            part.rename(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def publish(part: Path, path: Path) -> None:
    """Move a written file into its place once it is on the disk; raises OSError."""
    sync(part)
    part.replace(path)
    if os.name == "posix":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def sync(path: Path) -> None:
    """Return once the contents of a file are on the disk; raises OSError."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def write_bytes(path: Path, data: bytes) -> None:
    """Write a small file atomically; raises UserError."""
    with staged(path) as part:
        part.write_bytes(data)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder for temporary files, removed at the end (after a crash: by `collect_temporary`)."""
    temporary = place_of_temporary()
    with owned(temporary, TEMPORARY) as name:
        folder = temporary / name
        folder.mkdir(mode=0o700)
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def collect_temporary() -> list[Path]:
    """Remove the temporary folders of our dead processes, and return them."""
    return collect_orphans(place_of_temporary(), TEMPORARY)


def place_of_temporary() -> Path:
    """Return the folder that holds temporary folders; raises UserError if none can be written or used."""
    try:
        return checked_name(Path(tempfile.gettempdir()))
    except OSError:
        raise UserError(
            "no folder for temporary files can be written; free some space, or name another by TMPDIR"
        ) from None


def collect_orphans(folder: Path, prefix: str = PART) -> list[Path]:
    """Remove the unfinished files and folders of dead processes in a folder, and return them."""
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
    """List the files in a folder, named by `owned_name`, whose processes are dead; their locks come last.

    Processes that may be alive are skipped, and so is a folder that cannot be read. `lock` is the file that
    the processes held instead of the locks beside the files.
    """
    found = []
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            match = _OWNED.fullmatch(path.name.removeprefix(prefix)) if path.name.startswith(prefix) else None
            if match is not None:
                held = lock or folder / f"{prefix}{match['name']}{LOCK}"
                if is_abandoned(held):
                    found.append(path)
    return sorted(found, key=lambda path: path.name.endswith(LOCK))
