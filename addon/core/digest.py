"""Digests of files by their contents, wherever they lie and whenever they were copied."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from .errors import UserError

WHOLE = 64 << 20
"""Bytes up to which a file is read as a whole; of a larger one, a clip of minutes, the head, the tail and
`SAMPLES` pieces between are, which takes a tenth of a second. An encoder that changes one frame changes the
sizes and places of what follows."""
SAMPLES, PIECE = 64, 256 << 10

_known: dict[tuple[str, int, int], str] = {}
"""By path, size and time of change in ns: an unchanged file is not read again in the same run."""


def file_digest(path: Path) -> str:
    """64 hexadecimal digits of a file's contents. UserError where it cannot be read."""
    try:
        state = path.stat()
        key = (str(path), state.st_size, state.st_mtime_ns)
        if key not in _known:
            _known[key] = _digest(path, state.st_size)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None
    return _known[key]


def files_digest(paths: Iterable[Path]) -> str:
    """64 hexadecimal digits of several files' names and contents, in the order given."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(f"{path.name}\n{file_digest(path)}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()


def _digest(path: Path, size: int) -> str:
    digest = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        if size <= WHOLE:
            while piece := file.read(1 << 20):
                digest.update(piece)
        else:
            for number in range(SAMPLES):
                file.seek((size - PIECE) * number // (SAMPLES - 1))
                digest.update(file.read(PIECE))
    return digest.hexdigest()
