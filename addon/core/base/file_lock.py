"""Files that a process holds while it lives, by a lock of the operating system's that ends with it."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from .errors import UserError
from .processes import is_gone, process_table
from .regular_file import is_regular, read_regular

HELD = {errno.EACCES, errno.EAGAIN, errno.EDEADLK}
"""Errors of the system for a lock of another process."""
NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}
"""Errors of a file system without locks."""
LONGEST = 1 << 16
"""Bytes of a lock's file at most: its owner takes a hundred."""
FAR = 1 << 30
"""Byte that Windows locks: past the text, which others could not read otherwise."""
PATIENCE, PAUSE = 0.2, 0.01
"""Seconds for which a lock is tried, and between two tries: `is_abandoned` holds one for less than that."""


class FileLock:
    """Holds a file until `release`, or to the end of a `with`; the file is there only meanwhile.

    The lock is the operating system's, on the file, so it ends with its process: none is ever left over,
    whatever file is. A file system that knows no locks is used without.
    """

    def __init__(self, path: Path, refused: Callable[[str], UserError], patience: float = PATIENCE) -> None:
        """Claim a lock.

        Args:
            path: The lock file.
            refused: Makes the error for its owner, such as " by process 4".
            patience: Seconds to wait.

        Raises:
            OSError: The lock file cannot be made.
        """
        self._path = path
        self._file: int | None = None
        self.is_locked = False
        """True if the system excludes others."""
        until = time.monotonic() + patience
        while self._file is None:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _lock(file)
                # Between opening and locking its owner may have removed it: then it is nobody's lock.
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
        # The content is information only: a full disk is no reason to fail here.
        with contextlib.suppress(OSError):
            _write_owner(self._file)

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _where: TracebackType | None
    ) -> None:
        self.release()

    def release(self) -> None:
        """Let others have it; harmless when done before."""
        if self._file is None:
            return
        file, self._file = self._file, None
        if sys.platform == "win32":
            # An open file cannot be removed there, neither by us nor while the next owner has it.
            os.close(file)
            self._remove()
        else:
            # While it is locked, so that the file that is removed is ours.
            self._remove()
            os.close(file)

    def _remove(self) -> None:
        with contextlib.suppress(OSError):
            self._path.unlink()


def is_abandoned(lock: Path, table: str, pid: int) -> bool:
    """Return whether the owner of a lock file has certainly ended.

    Without locks, this is known only for a process of this table by `process_table`, from its number.
    """
    try:
        file = os.open(lock, os.O_RDWR) if is_regular(lock) else None
    except OSError:
        file = None
    if file is None:
        return is_gone(table, pid)
    try:
        _lock(file)
    except OSError as error:
        return error.errno not in HELD and is_gone(table, pid)
    finally:
        os.close(file)
    return True


def owner_of(lock: Path) -> dict[str, object]:
    """Return the content of a lock file about its owner; empty if it is unreadable."""
    try:
        return dict(json.loads(read_regular(lock, LONGEST)))
    except (OSError, ValueError, TypeError):
        # It was just let go, or is just being written.
        return {}


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
    owner = {
        "pid": os.getpid(), "table": process_table(), "host": socket.gethostname(),
        "since": time.strftime("%H:%M"),
    }  # fmt: skip
    os.ftruncate(file, 0)
    os.lseek(file, 0, os.SEEK_SET)
    os.write(file, json.dumps(owner).encode())


def _who(owner: dict[str, object]) -> str:
    if owner.get("pid") == os.getpid() and owner.get("table") == process_table():
        return f" here since {owner.get('since')}"
    if owner:
        return f" by process {owner.get('pid')} on {owner.get('host')} since {owner.get('since')}"
    return ""
