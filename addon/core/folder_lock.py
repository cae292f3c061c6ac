"""One solve at a time in a working folder, whichever process asks."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import sys
import time
from pathlib import Path

from .errors import Remedy, UserError

NAME = ".solving.lock"
HELD = {errno.EACCES, errno.EAGAIN, errno.EDEADLK}
"""What the systems say of a lock that somebody else has."""
FAR = 1 << 30
"""Byte that Windows locks: past the text, which others could not read otherwise."""


class FolderLock:
    """Holds an existing folder until `release`. UserError naming the owner where it is held already.

    The lock is the operating system's, on a file in the folder, so it ends with its process: none is ever
    left over, whatever file is. A file system that knows no locks is used without.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._file: int | None = None
        while self._file is None:
            file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                _lock(file)
                # Between opening and locking its owner may have removed it: then it is nobody's lock.
                if _is_same(file, self._path):
                    _write_owner(file)
                    self._file = file
            except OSError as error:
                if error.errno in HELD:
                    raise UserError(_held(folder, _owner(self._path)), Remedy.WORK_DIR) from None
                if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS):
                    raise
                self._file = file
            finally:
                if self._file is None:
                    os.close(file)

    def release(self) -> None:
        """Let others have the folder; harmless when done before."""
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
    owner = {"pid": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%H:%M")}
    os.ftruncate(file, 0)
    os.lseek(file, 0, os.SEEK_SET)
    os.write(file, json.dumps(owner).encode())


def _owner(path: Path) -> dict[str, object]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        # It was just let go, or is just being written.
        return {}


def _held(folder: Path, owner: dict[str, object]) -> str:
    if owner.get("pid") == os.getpid() and owner.get("host") == socket.gethostname():
        who = f" here since {owner['since']}"
    elif owner:
        who = f" by process {owner.get('pid')} on {owner.get('host')} since {owner.get('since')}"
    else:
        who = ""
    return f"{folder} is being solved into{who}; wait for it or cancel it, or name another folder"
