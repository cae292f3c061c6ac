"""One solve at a time in a working folder, and one run at a time a movie, whichever process asks."""

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

from .atomic import is_alive
from .errors import Remedy, UserError
from .regular_file import read_regular

NAME = ".solving.lock"
OUTPUT = ".virtual-aperture-"
"""Begins the name of an output's lock, which ends in .lock."""
HELD = {errno.EACCES, errno.EAGAIN, errno.EDEADLK}
"""What the systems say of a lock that somebody else has."""
LONGEST = 1 << 16
"""Bytes of a lock's file at most: its owner takes a hundred."""
FAR = 1 << 30
"""Byte that Windows locks: past the text, which others could not read otherwise."""


class FileLock:
    """Holds a file until `release`, or to the end of a `with`; the file is there only meanwhile.

    The lock is the operating system's, on the file, so it ends with its process: none is ever left over,
    whatever file is. A file system that knows no locks is used without.
    """

    def __init__(self, path: Path, refused: Callable[[str], UserError]) -> None:
        """`refused` makes the error for who has it, as " by process 4"; OSError where none can be made."""
        self._path = path
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
                    raise refused(_who(_owner(self._path))) from None
                if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS):
                    raise
                self._file = file
            finally:
                if self._file is None:
                    os.close(file)

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


class FolderLock(FileLock):
    """Holds an existing folder for solving. UserError naming the owner where it is held already."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            folder / NAME,
            lambda who: UserError(
                f"{folder} is being solved into{who}; wait for it or cancel it, or name another folder",
                Remedy.WORK_DIR,
            ),
        )


class OutputLock(FileLock):
    """Holds a file that is being made, in a folder that is made if need be.

    UserError naming the owner where it is held already, or where its folder cannot be written.
    """

    def __init__(self, out: Path) -> None:
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            collect_locks(out.parent)
            super().__init__(
                out.with_name(f"{OUTPUT}{out.name}.lock"),
                lambda who: UserError(
                    f"{out} is being written{who}; wait for it or cancel it, or name another file"
                ),
            )
        except OSError as error:
            raise UserError(f"{out} cannot be written: {error.strerror or error}") from error


def collect_locks(folder: Path) -> None:
    """Remove the files of the output locks whose owners are dead."""
    for path in folder.glob(f"{OUTPUT}*.lock"):
        owner = _owner(path)
        # One without an owner is just being made: to hold it meanwhile would send its owner away.
        if owner.get("host") == socket.gethostname() and not is_alive(int(str(owner.get("pid", 0)))):
            with contextlib.suppress(UserError, OSError):
                FileLock(path, UserError).release()


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
        return dict(json.loads(read_regular(path, LONGEST)))
    except (OSError, ValueError):
        # It was just let go, or is just being written.
        return {}


def _who(owner: dict[str, object]) -> str:
    if owner.get("pid") == os.getpid() and owner.get("host") == socket.gethostname():
        return f" here since {owner['since']}"
    if owner:
        return f" by process {owner.get('pid')} on {owner.get('host')} since {owner.get('since')}"
    return ""
