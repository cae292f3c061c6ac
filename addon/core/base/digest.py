"""Digests of files by all of their bytes, remembered while the system reports the files unchanged.

SHA-256 reads 1.3 GiB a second where the processor has instructions for it, as those since 2019 have. So a
digest is remembered with each file's path, size, inode, and times of modification and change in ns; for large
files on disk, too, for the next process. The time of change, which nobody can set, shows a change whose time
of modification was put back. Windows has none.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from . import atomic
from .errors import UserError
from .progress import checkpoint
from .regular_file import open_regular, read_regular, regular_stat

LARGE = 64 << 20
"""Bytes of files together from which on they are not read at a glance, and their digest is kept on disk: a
tenth of a second's reading."""
SETTLED = 3.0
"""Seconds since a file was changed after which a further change has another time. FAT counts
in steps of two."""
MOST_KEPT = 1000
"""Digests kept on disk, 130 bytes each; the oldest are dropped first."""

_known: dict[str, str] = {}
"""Digests by `Files._key`: an unchanged file is not read again in the same process."""


def file_digest(path: Path) -> str:
    """64 hexadecimal digits of all bytes of a file. UserError where it is none, or cannot be read."""
    return Files([path], named=False).digest()


class Files:
    """One file, or the pictures of a sequence, in the state that the system reports now."""

    def __init__(self, paths: Sequence[Path], named: bool) -> None:
        """With `named` the digest covers the names of the files, too. UserError where one is missing."""
        self._paths, self._named = paths, named
        self._states = [_stat(path) for path in paths]
        self.size = sum(state.st_size for state in self._states)

    @property
    def is_large(self) -> bool:
        """Return whether reading the whole file takes too long for a panel."""
        return self.size > LARGE

    def known_digest(self) -> str | None:
        """`digest`, where it is remembered; else None."""
        key = self._key()
        if key not in _known and self.is_large and key in (kept := _kept()):
            _known[key] = kept[key]
        return _known.get(key)

    def digest(self) -> str:
        """64 hexadecimal digits of all bytes, in the order given. UserError where one cannot be read."""
        if (known := self.known_digest()) is not None:
            return known
        key, began = self._key(), time.time()
        try:
            found = self._joined() if self._named else _digest(self._paths[0])
        except OSError as error:
            where = error.filename or self._paths[0]
            raise UserError(f"{where} cannot be read: {error.strerror or error}") from None
        if Files(self._paths, self._named)._key() == key:
            _known[key] = found
            times = [when for state in self._states for when in (state.st_mtime, state.st_ctime)]
            if self.is_large and all(abs(began - when) > SETTLED for when in times):
                _keep(key, found)
        return found

    def _joined(self) -> str:
        digest = hashlib.sha256()
        for path in self._paths:
            digest.update(f"{path.name}\n{file_digest(path)}\n".encode(errors="surrogateescape"))
        return digest.hexdigest()

    def _key(self) -> str:
        """32 hexadecimal digits of the system's information, which changes with the file."""
        parts = [str(self._named)]
        for path, state in zip(self._paths, self._states, strict=True):
            times = state.st_mtime_ns, state.st_ctime_ns
            parts.append(f"{path.absolute()}\n{state.st_size} {times} {state.st_ino}")
        return hashlib.sha256("\n".join(parts).encode(errors="surrogateescape")).hexdigest()[:32]


def _stat(path: Path) -> os.stat_result:
    try:
        return regular_stat(path)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from None


def _digest(path: Path) -> str:
    """64 hexadecimal digits of the size and all bytes of a file."""
    with open_regular(path) as file:
        left = os.fstat(file.fileno()).st_size
        digest = hashlib.sha256(str(left).encode())
        # No more than its size: growing files, and files without a size, would never end.
        while left > 0 and (piece := file.read(min(left, 1 << 20))):
            digest.update(piece)
            left -= len(piece)
            checkpoint()
    return digest.hexdigest()


def _store() -> Path:
    """The file of kept digests, in the user's cache folder."""
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = Path.home() / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return caches / "virtual-aperture" / "digests.json"


def _kept() -> dict[str, str]:
    """Digests by `Files._key` that processes kept, the oldest first; none where that cannot be read."""
    try:
        kept = json.loads(read_regular(_store(), 1 << 20))
    except (OSError, ValueError, RecursionError, RuntimeError):  # RuntimeError: there is no home
        return {}
    return kept if isinstance(kept, dict) and all(isinstance(one, str) for one in kept.values()) else {}


def _keep(key: str, digest: str) -> None:
    """Keep a digest for other processes; if that fails the file is read again."""
    # If two write at once, one digest may be lost, which costs little.
    kept = _kept() | {key: digest}
    last = dict(list(kept.items())[-MOST_KEPT:])
    with contextlib.suppress(UserError, RuntimeError):
        atomic.write_bytes(_store(), json.dumps(last).encode())
