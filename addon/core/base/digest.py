"""Digests of files by their contents, wherever they lie and whenever they were copied."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from .errors import UserError

WHOLE = 64 << 20
"""Bytes up to which a file is read as a whole; of a larger one, a clip of minutes, the head, the tail and
`SAMPLES` pieces between are, which takes a tenth of a second. An encoder that changes one frame changes the
sizes and places of what follows."""
SAMPLES, PIECE = 64, 256 << 10
MANY = 512 << 20
"""Bytes of a clip's pictures together up to which each is read as `file_digest` does. Of more of them, a clip
of minutes in EXR, `FEW_SAMPLES` pieces of `FEW_PIECE` bytes of each are: encoded pictures that differ
anywhere differ to their end."""
FEW_SAMPLES, FEW_PIECE = 4, 16 << 10

_known: dict[tuple[str, int, int, int, int], str] = {}
"""By path, size, times of change in ns and how much is read: an unchanged file is not read again in the same
run."""


def file_digest(path: Path) -> str:
    """64 hexadecimal digits of a file's contents. UserError where it cannot be read."""
    return _remembered(path, WHOLE, SAMPLES, PIECE)


def whole_digest(path: Path) -> str:
    """64 hexadecimal digits of all bytes of a file, however large. UserError where it cannot be read."""
    return _remembered(path, sys.maxsize, 0, 0)


def pictures_digest(paths: Sequence[Path]) -> str:
    """64 hexadecimal digits of the files of a sequence, their names and contents, in the order given.

    Quick for any clip, so that a panel can ask: what has changed in a few pixels of a large picture that is
    not compressed may go unseen. UserError where one cannot be read.
    """
    try:
        few = sum(path.stat().st_size for path in paths) > MANY
    except OSError as error:
        raise UserError(f"{error.filename} cannot be read: {error.strerror}") from None
    how = (FEW_SAMPLES * FEW_PIECE, FEW_SAMPLES, FEW_PIECE) if few else (WHOLE, SAMPLES, PIECE)
    digest = hashlib.sha256()
    for path in paths:
        digest.update(f"{path.name}\n{_remembered(path, *how)}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _remembered(path: Path, whole: int, samples: int, piece: int) -> str:
    try:
        state = path.stat()
        key = (str(path), state.st_size, state.st_mtime_ns, state.st_ctime_ns, whole)
        if key not in _known:
            _known[key] = _digest(path, state.st_size, whole, samples, piece)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    return _known[key]


def files_digest(paths: Iterable[Path]) -> str:
    """64 hexadecimal digits of several files' names and contents, in the order given."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(f"{path.name}\n{file_digest(path)}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _digest(path: Path, size: int, whole: int, samples: int, length: int) -> str:
    digest = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        if size <= whole:
            while piece := file.read(1 << 20):
                digest.update(piece)
        else:
            for number in range(samples):
                file.seek((size - length) * number // (samples - 1))
                digest.update(file.read(length))
    return digest.hexdigest()
