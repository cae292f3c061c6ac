"""Search for a clip that was moved, by its name and content."""

from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path

from ..base.errors import UserError
from .clip_identity import is_same_clip
from .sequence import is_litter, is_pattern, pattern_numbers

LEVELS = "*/", "*/*/"
"""Folders below a folder that are looked into."""
MOST_FOLDERS = 500
"""Looked into at most, of each level: the .blend may lie in a home folder."""


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
