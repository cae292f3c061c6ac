"""Search for a clip that was moved, by its name and content."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from ..base.errors import UserError
from .clip_identity import is_same_clip
from .sequence import is_pattern, pattern_numbers

LEVELS = 2
"""Folders below each other that are looked into."""
MOST_FOLDERS = 500
"""Looked into at most: the .blend may lie in a home folder."""


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
    level, count = [top], 0
    for _ in range(LEVELS + 1):
        deeper: list[Path] = []
        for folder in level:
            yield folder
            count += 1
            if count == MOST_FOLDERS:
                return
            try:
                deeper += sorted(path for path in folder.iterdir() if path.is_dir() and path.name[0] != ".")
            except OSError:
                continue
        level = deeper
