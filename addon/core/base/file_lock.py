"""Lock files of working folders and outputs, by locks of the operating system that end with their process."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from .errors import Remedy, UserError
from .regular_file import is_regular, read_object

HELD = {errno.EACCES, errno.EAGAIN, errno.EDEADLK}
"""Error numbers for a lock that another process holds."""
NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}
"""Error numbers of a file system without locks."""
LONGEST = 1 << 16
"""Most bytes of a lock file; its owner takes a hundred."""
FAR = 1 << 30
"""Byte that Windows locks: beyond the text, which other processes could not read otherwise."""
PATIENCE, PAUSE = 0.2, 0.01
"""Seconds for which a lock is tried, and between tries; `is_abandoned` holds a lock for less than the first.
"""
NAME = ".solving.lock"
OUTPUT = ".virtual-aperture-"
"""Prefix of an output's lock, which ends in .lock."""


class FileLock:
    """Holds a lock on a file until `release` or the end of a `with`; the file exists only in that time.

    The lock ends with its process, even if the file is left. On a file system without locks, none is used.

    Args:
        path: The lock file; OSError is raised if it cannot be made.
        refused: Makes the error from the lock's owner, such as " by process 4".
        patience: Seconds to wait for another owner.
    """

    def __init__(self, path: Path, refused: Callable[[str], UserError], patience: float = PATIENCE) -> None:
        self._path = path
        self._file: int | None = None
        self.is_locked = False
        """True if the system excludes other processes."""
        until = time.monotonic() + patience
        while self._file is None:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _lock(file)
                # The file may be removed by its owner between opening and locking: then the lock is
                # worthless.
                if _is_same(file, self._path):
                    self._file, self.is_locked = file, True
            except OSError as error:
                if error.errno in NO_LOCKS:
                    self._file = file
                elif error.errno not in HELD:
                    raise
                elif time.monotonic() > until:
                    raise refused(_who(owner_of(self._path))) from None
                else:
                    time.sleep(PAUSE)
            finally:
                if self._file is None:
                    os.close(file)
        # The owner is only for messages: a full disk is no reason to fail here.
        with contextlib.suppress(OSError):
            _write_owner(self._file)

    def __enter__(self) -> None:
        return None

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Release the lock; harmless if it is released already."""
        if self._file is None:
            return
        file, self._file = self._file, None
        if sys.platform == "win32":
            # Windows cannot remove an open file, neither ours nor the next owner's.
            os.close(file)
            self._remove()
        else:
            # Removed while locked, so that the removed file is ours.
            self._remove()
            os.close(file)

    def _remove(self) -> None:
        with contextlib.suppress(OSError):
            self._path.unlink()


@contextlib.contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Hold a lock file unless another process does; yields whether none does. Without locks, none does."""
    is_free = True
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(FileLock(path, UserError, patience=0))
        except UserError:
            is_free = False
        except OSError:
            pass
        yield is_free


def is_abandoned(lock: Path) -> bool:
    """Return whether the process that held a lock file has certainly ended.

    It is unknown on a file system without locks, and of a file that is gone.
    """
    with contextlib.suppress(OSError):
        if is_regular(lock):
            file = os.open(lock, os.O_RDWR)
            try:
                _lock(file)
                return True
            finally:
                os.close(file)
    return False


def owner_of(lock: Path) -> dict[str, object]:
    """Read the owner that a lock file names; empty if it was just released, or is being written."""
    return read_object(lock, LONGEST)


def _lock(file: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        os.lseek(file, FAR, os.SEEK_SET)
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_same(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False


def _write_owner(file: int) -> None:
    owner = {"pid": os.getpid(), "host": host_name(), "since": time.strftime("%H:%M")}
    os.ftruncate(file, 0)
    os.lseek(file, 0, os.SEEK_SET)
    os.write(file, json.dumps(owner).encode())


def _who(owner: dict[str, object]) -> str:
    if owner.get("pid") == os.getpid() and owner.get("host") == host_name():
        return f" here since {owner.get('since')}"
    if owner:
        return f" by process {owner.get('pid')} on {owner.get('host')} since {owner.get('since')}"
    return ""


class FolderLock(FileLock):
    """Holds an existing folder for solving; raises UserError with the owner's name if it is held."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            folder / NAME,
            lambda who: UserError(
                f"{folder} is being solved into{who}; wait for it, cancel it, or choose another folder",
                Remedy.WORK_DIR,
            ),
        )


class OutputLock(FileLock):
    """Holds an output file and makes its folder; raises UserError if it is held or cannot be written."""

    def __init__(self, out: Path) -> None:
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            collect_locks(out.parent)
            super().__init__(
                out.with_name(f"{OUTPUT}{out.name}.lock"),
                lambda who: UserError(
                    f"{out} is being written{who}; wait for it, cancel it, or choose another file"
                ),
            )
        except OSError as error:
            raise UserError(f"{out} cannot be written: {error.strerror or error}") from error


def collect_locks(folder: Path) -> None:
    """Remove the output locks whose owners have ended."""
    for path in folder.glob(f"{OUTPUT}*.lock"):
        if is_abandoned(path):
            with contextlib.suppress(UserError, OSError):
                FileLock(path, UserError).release()


def host_name() -> str:
    """Return the name of this machine; empty if the system does not report it."""
    return os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
