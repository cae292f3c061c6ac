"""The identity of a clip, and the search for it where it was solved, or near its solve."""

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from ..base.digest import Files
from ..base.errors import UserError
from .sequence import clip_files, is_litter, is_pattern, pattern_numbers

SMALL = "2:"
"""Begins the identity of a small clip, by all of its bytes."""
LARGE = "4:"
"""Begins the identity of a large clip: its size in bytes, which can be compared at a glance, and then the
digest of all bytes."""
LEVELS = "*/", "*/*/"
"""Folders below a folder that are looked into."""
MOST_FOLDERS = 500
"""Looked into at most, of each level: the .blend may lie in a home folder."""


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


def clip_exists(path: Path) -> bool:
    """Return whether a video, a folder, or at least one picture of a pattern is there."""
    try:
        if is_pattern(path):
            return path.parent.is_dir() and any(pattern_numbers(path))
        return path.exists()
    except OSError:
        return False


def is_clip(path: Path, wanted: str, at_a_glance: bool = False) -> bool:
    """Return whether a path leads to the clip of an identity; False if it is unreadable."""
    try:
        return clip_exists(path) and is_same_clip(path, wanted, at_a_glance)
    except UserError:
        return False


def find_clip(
    name: str, wanted: str, places: Iterable[Path], below: Path | None, at_a_glance: bool = False
) -> Path | None:
    """Find the clip of an identity by its name: a video, a folder or a pattern. None without one.

    `places` are tried first, then the folder `below` and its subfolders. `at_a_glance` as in `is_same_clip`.
    """
    for place in places:
        if is_clip(place, wanted, at_a_glance):
            return place
    for folder in _folders(below) if below is not None else ():
        if is_clip(folder / name, wanted, at_a_glance):
            return folder / name
    return None


def _folders(top: Path) -> Iterator[Path]:
    """A folder and those below it, the nearest first."""
    yield top
    for pattern in LEVELS:
        found = (path for path in top.glob(pattern) if not is_litter(str(path.relative_to(top))))
        yield from sorted(islice(found, MOST_FOLDERS))
