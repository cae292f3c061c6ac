"""What a clip is recognised by, wherever it lies and whatever it is called."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..base.digest import file_digest, pictures_digest
from ..base.errors import UserError
from .clip import clip_files, open_footage

VERSION = "2:"
"""Begins an identity. Those of older solves and scenes, without it, are of a video's ends and of the names
and sizes of a sequence's pictures."""

_known: dict[tuple[Path, bool], tuple[tuple[tuple[str, int, int, int], ...], str]] = {}
"""By path, and whether in the old way: sizes and times of the files, and the identity."""


def identity(path: Path) -> str:
    """A clip's identity, by the contents of a video or the names and contents of a sequence's pictures.

    Read again only when the sizes or times of its files change. UserError where it cannot be read.
    """
    return _identity(path, is_old=False)


def is_same_clip(path: Path, wanted: str) -> bool:
    """Whether a clip has an identity, which may be an older version's. UserError where it cannot be read."""
    return _identity(path, is_old=not wanted.startswith(VERSION)) == wanted


def _identity(path: Path, is_old: bool) -> str:
    try:
        files = clip_files(path)
        told = [(file.name, file.stat()) for file in files]
        stamp = tuple((name, s.st_size, s.st_mtime_ns, s.st_ctime_ns) for name, s in told)
        known = _known.get((path, is_old))
        if known is None or known[0] != stamp:
            found = _old(path, files) if is_old else _contents(path, files)
            known = _known[path, is_old] = (stamp, found)
    except OSError as error:
        raise UserError(f"{error.filename or path} cannot be read: {error.strerror or error}") from None
    return known[1]


def _contents(path: Path, files: list[Path]) -> str:
    return VERSION + (file_digest(path) if files == [path] else pictures_digest(files))


def _old(path: Path, files: list[Path]) -> str:
    digest = hashlib.sha256()
    if files == [path]:
        size = path.stat().st_size
        with path.open("rb") as file:
            digest.update(str(size).encode() + file.read(1 << 20))
            file.seek(max(0, size - (1 << 20)))
            digest.update(file.read())
    else:
        # In the order of their frame numbers.
        for image in open_footage(path).files:
            digest.update(f"{image.name}\n{image.stat().st_size}\n".encode())
    return digest.hexdigest()
