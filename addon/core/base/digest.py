"""Digests of files by all of their bytes, wherever they lie and whenever they were copied.

Reading takes time: SHA-256 is done with 1.3 GiB a second where the processor has instructions for it, as
those since 2019 have, and BLAKE2b with half of that; a disk may be slower. So what was read is remembered
with what the system says of the file: its path, size, times of modification and change in ns, and inode. For
large files that is kept on disk, for the next process. Who changes a file and puts its time of modification
back is seen by the time of change, which nobody can set; Windows has none, and there such a change is not
seen where the file was read before.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from . import atomic
from .errors import UserError
from .progress import checkpoint
from .regular_file import open_regular, read_regular, regular_stat

LARGE = 64 << 20
"""Bytes of a file from which on `Files.sample` reads the head, the tail and `SAMPLES` pieces, which takes a
tenth of a second; and its whole digest is kept on disk. By eye."""
SAMPLES, PIECE = 64, 256 << 10
MANY = 512 << 20
"""Bytes of pictures together from which on it reads `FEW_SAMPLES` pieces of `FEW_PIECE` bytes of each: a
clip of minutes in EXR."""
FEW_SAMPLES, FEW_PIECE = 4, 16 << 10
SETTLED = 3.0
"""Seconds since a file was changed after which a further change has another time. FAT counts
in steps of two."""
MOST_KEPT = 1000
"""Digests kept on disk, 130 bytes each; the oldest go first."""

_known: dict[str, str] = {}
"""Digests by `Files.key`: an unchanged file is not read again in the same process."""


def file_digest(path: Path) -> str:
    """64 hexadecimal digits of all bytes of a file. UserError where it is none, or cannot be read."""
    return Files([path], named=False).digest()


class Files:
    """One file, or the pictures of a sequence, as the system tells of them now."""

    def __init__(self, paths: Sequence[Path], named: bool) -> None:
        """`named` has the names of the files in their digests. UserError where one is none, or not there."""
        self._paths, self._named = paths, named
        self._states = [_stat(path) for path in paths]

    @property
    def is_sampled(self) -> bool:
        """Whether `sample` leaves out bytes."""
        sizes = [state.st_size for state in self._states]
        return max(sizes, default=0) > LARGE or (len(sizes) > 1 and sum(sizes) > MANY)

    def digest(self) -> str:
        """64 hexadecimal digits of all bytes, in the order given. UserError where one cannot be read."""
        if self._named:
            return self.remembered("files", lambda: self._joined(file_digest), keep=self.is_sampled)
        return self.remembered("file", lambda: _digest(self._paths[0], sys.maxsize, 0, 0), self.is_sampled)

    def known_digest(self) -> str | None:
        """`digest`, where it is remembered; else None."""
        return _recall(self.key("files" if self._named else "file"), self.is_sampled)

    def sample(self) -> str:
        """`digest` of small files; of many or large ones the sizes and samples, in a tenth of a second.

        Quick for any clip, so that a panel can ask. Files that differ in it are different. UserError where
        one cannot be read.
        """
        if not self.is_sampled:
            return self.digest()
        if not self._named:
            return self.remembered("sample", lambda: _digest(self._paths[0], LARGE, SAMPLES, PIECE))
        if sum(state.st_size for state in self._states) <= MANY:
            return self._joined(lambda path: Files([path], named=False).sample())
        few = FEW_SAMPLES * FEW_PIECE, FEW_SAMPLES, FEW_PIECE
        return self.remembered("samples", lambda: self._joined(lambda path: _digest(path, *few)))

    def remembered(self, kind: str, make: Callable[[], str], keep: bool = False) -> str:
        """A kind of digest of the files: remembered, with `keep` also on disk, or made by reading them.

        UserError where `make` raises OSError.
        """
        key, began = self.key(kind), time.time()
        found = _recall(key, keep)
        if found is not None:
            return found
        try:
            found = make()
        except OSError as error:
            where = error.filename or self._paths[0]
            raise UserError(f"{where} cannot be read: {error.strerror or error}") from None
        if Files(self._paths, self._named).key(kind) == key:
            _known[key] = found
            if keep and self._is_settled(began):
                _keep(key, found)
        return found

    def key(self, kind: str) -> str:
        """32 hexadecimal digits of what the system tells: others once a file is changed."""
        parts = [kind]
        for path, state in zip(self._paths, self._states, strict=True):
            times = state.st_mtime_ns, state.st_ctime_ns
            parts.append(f"{path.absolute()}\n{state.st_size} {times} {state.st_ino}")
        return hashlib.sha256("\n".join(parts).encode(errors="surrogateescape")).hexdigest()[:32]

    def _is_settled(self, now: float) -> bool:
        """Whether a change from `now` (seconds) on gives each file another time than it has."""
        times = [when for state in self._states for when in (state.st_mtime, state.st_ctime)]
        return all(abs(now - when) > SETTLED for when in times)

    def _joined(self, digest_of: Callable[[Path], str]) -> str:
        digest = hashlib.sha256()
        for path in self._paths:
            digest.update(f"{path.name}\n{digest_of(path)}\n".encode(errors="surrogateescape"))
        return digest.hexdigest()


def _stat(path: Path) -> os.stat_result:
    try:
        return regular_stat(path)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from None


def _recall(key: str, is_kept: bool) -> str | None:
    if key not in _known and is_kept and key in (kept := _kept()):
        _known[key] = kept[key]
    return _known.get(key)


def _digest(path: Path, whole: int, samples: int, length: int) -> str:
    """Of the size and all bytes of a file of at most `whole` bytes, else of `samples` pieces of `length`."""
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        digest = hashlib.sha256(str(size).encode())
        if size <= whole:
            left = size
            # No more than it had: what grows, or has no size, such as the system's own, would never end.
            while left > 0 and (piece := file.read(min(left, 1 << 20))):
                digest.update(piece)
                left -= len(piece)
                checkpoint()
        else:
            for number in range(samples):
                file.seek((size - length) * number // (samples - 1))
                digest.update(file.read(length))
    return digest.hexdigest()


def _store() -> Path:
    """The file of the digests that are kept, in the user's folder for what can be made again."""
    if sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        caches = Path.home() / "Library" / "Caches"
    else:
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return caches / "virtual-aperture" / "digests.json"


def _kept() -> dict[str, str]:
    """Digests by `Files.key` that processes kept, the oldest first; none where that cannot be read."""
    try:
        kept = json.loads(read_regular(_store(), 1 << 20))
    except (OSError, ValueError, RecursionError, RuntimeError):  # RuntimeError: there is no home
        return {}
    return kept if isinstance(kept, dict) and all(isinstance(one, str) for one in kept.values()) else {}


def _keep(key: str, digest: str) -> None:
    """Keep a digest for other processes. Where that cannot be written the file is read again."""
    # Of two that write at once one's may be lost, which costs as little.
    kept = _kept() | {key: digest}
    last = dict(list(kept.items())[-MOST_KEPT:])
    with contextlib.suppress(UserError, RuntimeError):
        atomic.write_bytes(_store(), json.dumps(last).encode())
