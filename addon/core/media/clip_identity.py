"""What a clip is recognised by, wherever it lies and whatever it is called."""

from __future__ import annotations

from pathlib import Path

from ..base.digest import Files
from ..base.errors import UserError
from .sequence import clip_files

SMALL = "2:"
"""Begins the identity of a small clip, by all of its bytes."""
WHOLE = "3:"
"""Begins the identity of a large clip: of its samples, by which another one is recognised at a glance, and of
all of its bytes."""


def identity(path: Path) -> str:
    """A clip's identity, by the contents of a video or the names and contents of a sequence's pictures.

    All of them are read, again only when the sizes or times of the files change. UserError where one cannot
    be.
    """
    files = _files(path)
    return f"{WHOLE}{files.sample()}:{files.digest()}" if files.is_sampled else SMALL + files.digest()


def clip_digest(path: Path) -> str:
    """64 hexadecimal digits of all bytes of a video, or the names and all bytes of a sequence's pictures.

    UserError where one cannot be read.
    """
    return _files(path).digest()


def is_same_clip(path: Path, wanted: str, at_a_glance: bool = False) -> bool:
    """Whether a clip has an identity. UserError where it cannot be read.

    With `at_a_glance` a large clip that was not read since it was changed is judged by its samples: a panel
    cannot wait for the whole.
    """
    files = _files(path)
    if not files.is_sampled:
        return SMALL + files.digest() == wanted
    sample, _, whole = wanted.removeprefix(WHOLE).partition(":")
    return files.sample() == sample and (
        (files.known_digest() if at_a_glance else files.digest()) in (None, whole)
    )


def _files(path: Path) -> Files:
    try:
        files = clip_files(path)
    except OSError as error:
        raise UserError(f"{error.filename or path} cannot be read: {error.strerror or error}") from None
    return Files(files, named=files != [path])
