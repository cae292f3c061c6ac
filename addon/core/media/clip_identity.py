"""What a clip is recognised by, wherever it lies and whatever it is called."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..base.digest import Files
from ..base.errors import UserError
from ..base.regular_file import open_regular
from .clip import clip_files, open_footage

SAMPLED = "2:"
"""Begins the identity of a small clip, by all of its bytes, and the one that older versions gave a large
clip, by its samples."""
WHOLE = "3:"
"""Begins the identity of a large clip: of its samples, by which another one is told at a glance, and of all
of its bytes. Those of the oldest solves have no version: of a video's ends, and of the names and sizes of a
sequence's pictures."""


def identity(path: Path) -> str:
    """A clip's identity, by the contents of a video or the names and contents of a sequence's pictures.

    All of them are read, again only when the sizes or times of the files change. UserError where one cannot
    be.
    """
    files = _files(path)
    return f"{WHOLE}{files.sample()}:{files.digest()}" if files.is_sampled else SAMPLED + files.digest()


def clip_digest(path: Path) -> str:
    """64 hexadecimal digits of all bytes of a video, or the names and all bytes of a sequence's pictures.

    UserError where one cannot be read.
    """
    return _files(path).digest()


def is_same_clip(path: Path, wanted: str, at_a_glance: bool = False) -> bool:
    """Whether a clip has an identity, which may be an older version's. UserError where it cannot be read.

    With `at_a_glance` a large clip that was not read since it was changed is judged by its samples: a panel
    cannot wait for the whole.
    """
    files = _files(path)
    if not wanted.startswith((SAMPLED, WHOLE)):
        return files.remembered("oldest", lambda: _oldest(path)) == wanted
    sample, _, whole = wanted[len(WHOLE) :].partition(":")
    if files.sample() != sample:
        return False
    return not whole or (files.known_digest() if at_a_glance else files.digest()) in (None, whole)


def _files(path: Path) -> Files:
    try:
        files = clip_files(path)
    except OSError as error:
        raise UserError(f"{error.filename or path} cannot be read: {error.strerror or error}") from None
    return Files(files, named=files != [path])


def _oldest(path: Path) -> str:
    """The identity of the oldest solves. Raises OSError."""
    if clip_files(path) != [path]:
        # In the order of their frame numbers.
        entries = [f"{image.name}\n{image.stat().st_size}\n" for image in open_footage(path).files]
        return hashlib.sha256("".join(entries).encode()).hexdigest()
    with open_regular(path) as file:
        size = path.stat().st_size
        digest = hashlib.sha256(str(size).encode() + file.read(1 << 20))
        file.seek(max(0, size - (1 << 20)))
        digest.update(file.read(1 << 20))
    return digest.hexdigest()
