"""Digests of our own code, and of files by all of their bytes, remembered while files are unchanged.

SHA-256 reads 1.3 GiB/s on processors with instructions for it (since 2019). A digest is remembered by path,
size, inode, and times of modification and change in ns; for large files also on disk, for other processes.
The time of change, which no program can set, reveals a modification time that was put back. Windows has none.
"""

import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from . import atomic
from .errors import UserError
from .progress import checkpoint
from .regular_file import open_regular, read_object, regular_stat

LARGE = 64 << 20
"""Bytes. Larger files are not read in a panel, and their digest is kept on disk. Read in 0.1 s."""
SETTLED = 3.0
"""Seconds since a change after which another change has another time. FAT counts in steps of 2 s."""
MOST_KEPT = 1000
"""Digests kept on disk, 130 bytes each; the oldest are dropped first."""
_known: dict[str, str] = {}
"""Digests by `Files._key`, for this process."""
ADDON = Path(__file__).resolve().parents[2]


def file_digest(path: Path) -> str:
    """Return 64 hexadecimal digits of all bytes of a file; raises UserError if it cannot be read."""
    return Files([path], named=False).digest()


class Files:
    """One file, or the pictures of a sequence, as reported now; raises UserError if one is missing."""

    def __init__(self, paths: Sequence[Path], named: bool) -> None:
        """With `named`, the digest covers the names of the files, too."""
        self._paths, self._named = paths, named
        self._states = [_stat(path) for path in paths]
        self.size = sum(state.st_size for state in self._states)

    @property
    def is_large(self) -> bool:
        """Return whether reading all files takes too long for a panel."""
        return self.size > LARGE

    def known_digest(self) -> str | None:
        """Return the remembered digest, or None."""
        key = self._key()
        if key not in _known and self.is_large and key in (kept := _kept()):
            _known[key] = kept[key]
        return _known.get(key)

    def digest(self) -> str:
        """Return 64 hexadecimal digits of all bytes in order; raises UserError if one cannot be read."""
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
        """Return 32 hexadecimal digits of the reported state, which differ once a file is changed."""
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
    with open_regular(path) as file:
        left = os.fstat(file.fileno()).st_size
        digest = hashlib.sha256(str(left).encode())
        # No more bytes than the reported size: growing files and the system's own files would never end.
        while left > 0 and (piece := file.read(min(left, 1 << 20))):
            digest.update(piece)
            left -= len(piece)
            checkpoint()
    return digest.hexdigest()


def _store() -> Path:
    """Return the file of kept digests, in the user's cache folder."""
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = Path.home() / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return caches / "virtual-aperture" / "digests.json"


def _kept() -> dict[str, str]:
    """Read the kept digests by `Files._key`, the oldest first; none if the file cannot be read."""
    kept: dict[str, str] = {}
    with contextlib.suppress(RuntimeError):  # no home folder
        kept = read_object(_store(), 1 << 20)
    return kept if all(isinstance(one, str) for one in kept.values()) else {}


def _keep(key: str, digest: str) -> None:
    """Keep a digest for other processes, if the cache folder can be written."""
    # When two processes write at once, one digest may be lost; its file is then read again.
    kept = _kept() | {key: digest}
    last = dict(list(kept.items())[-MOST_KEPT:])
    with contextlib.suppress(UserError, RuntimeError):
        atomic.write_bytes(_store(), json.dumps(last).encode())


@cache
def code_digest(*rooms: str) -> str:
    """Digest all modules in some folders of `addon`, such as "core", to 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in rooms:
        for path in sorted((ADDON / room).rglob("*.py")):
            digest.update(path.relative_to(ADDON).as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()[:16]
