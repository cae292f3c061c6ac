"""The identity of a clip, independent of its path and name."""

from pathlib import Path

from ..base.digest import Files
from ..base.errors import UserError
from .sequence import clip_files

SMALL = "2:"
"""Begins the identity of a small clip, by all of its bytes."""
LARGE = "4:"
"""Begins the identity of a large clip: its size in bytes, which can be compared at a glance, and then the
digest of all bytes."""


def identity(path: Path) -> str:
    """Identify a clip by the contents of a video, or the names and contents of a sequence's pictures.

    All bytes are read, again only when the sizes or times of the files change. UserError where one cannot be.
    """
    files = _files(path)
    return f"{LARGE}{files.size}:{files.digest()}" if files.is_large else SMALL + files.digest()


def clip_digest(path: Path) -> str:
    """Return 64 hexadecimal digits of a video's bytes, or of a sequence's names and bytes.

    Raises:
        UserError: A file cannot be read.
    """
    return _files(path).digest()


def is_same_clip(path: Path, wanted: str, at_a_glance: bool = False) -> bool:
    """Return whether a clip has an identity; raises UserError if it cannot be read.

    For a panel, which cannot wait, a large clip that was not read since its last change is judged by its size
    `at_a_glance`.
    """
    files = _files(path)
    if not files.is_large:
        return SMALL + files.digest() == wanted
    size, _, digest = wanted.removeprefix(LARGE).partition(":")
    return str(files.size) == size and (
        (files.known_digest() if at_a_glance else files.digest()) in (None, digest)
    )


def _files(path: Path) -> Files:
    try:
        files = clip_files(path)
    except OSError as error:
        raise UserError(f"{error.filename or path} cannot be read: {error.strerror or error}") from None
    return Files(files, named=files != [path])
