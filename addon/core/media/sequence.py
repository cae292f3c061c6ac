"""The pictures of a sequence: which files of a folder they are, and the frame numbers in their names."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePosixPath

from ..base.errors import UserError
from .picture_file import ARRAY, PICTURES

LAST_FRAME = 1048574
"""Blender's last frame (MAXFRAME). It clamps larger numbers without an error."""
FILLED = 0.5
"""Share of a range of large numbers that has files, from which they are a camera's counter, whose gaps are
missing frames. Numbers that are sparser are times of day."""
LARGEST_INT = 2**31 - 1
"""Largest number in a file name that Blender parses."""
_PLACE = re.compile(r"#+|%0?(\d*)d")
_DIGITS = re.compile(r"\d+")
_LITTER = ("__MACOSX", "@eaDir")
"""Folders that macOS and Synology add to archives and shares."""


def is_litter(name: str) -> bool:
    """Return whether a file name, or a path in an archive, is a hidden or housekeeping file.

    macOS writes `._0001.png` and `__MACOSX/` beside the pictures, with their suffixes.
    """
    parts = PurePosixPath(name.replace("\\", "/")).parts
    return any(part in _LITTER or (part.startswith(".") and part != "..") for part in parts)


def is_pattern(path: Path) -> bool:
    """Return whether the path of a clip stands for numbered pictures: shot_####.png, shot_%04d.png.

    A file or a folder that is really called that is no pattern.
    """
    return _PLACE.search(path.name) is not None and not path.exists()


def clip_files(path: Path) -> list[Path]:
    """List the files of a clip, sorted by name.

    They are the video itself, the pictures of a folder, or else its arrays, or the files of a pattern. Raises
    UserError if a pattern's folder is missing, OSError if a folder cannot be listed.
    """
    if is_pattern(path):
        return sorted(pattern_numbers(path))
    if path.is_dir():
        there = [each for each in path.iterdir() if not is_litter(each.name)]
        pictures = [each for each in there if each.suffix.lower() in PICTURES]
        return sorted(pictures or [each for each in there if each.suffix.lower() == ARRAY])
    return [path]


def pattern_numbers(path: Path) -> dict[Path, int]:
    """Find the files that a pattern matches, and their frame numbers.

    In a pattern # is one digit, and %04d at least four. With several such places the frame number is the one
    that differs between the files. If no file matches all places, only the last one counts, as in names of
    rendered frames: the # in `take #3_####.png` is a part of the name. Raises UserError if the folder is
    missing.
    """
    if not path.parent.is_dir():
        raise UserError(f"{path.parent} does not exist; choose the folder that holds {path.name}")
    names, places = list(path.parent.iterdir()), list(_PLACE.finditer(path.name))
    for used in (places, places[-1:]):
        expression, end = "", 0
        for place in used:
            digits = place[1] or 1 if place[0].startswith("%") else len(place[0])
            expression += re.escape(path.name[end : place.start()]) + rf"(\d{{{digits},}})"
            end = place.end()
        expression += re.escape(path.name[end:])
        if found := {each: match for each in names if (match := re.fullmatch(expression, each.name))}:
            rows = [list(map(int, match.groups())) for match in found.values()]
            return dict(zip(found, _counts(rows), strict=True))
    return {}


def name_numbers(names: Sequence[str]) -> list[int] | None:
    """Read the frame number from each of file names, or paths in an archive; None if one has none.

    The frame number of a name with several, as in `desk_1001_v02.png`, is the last one that differs between
    all names. Two names may have the same one.
    """
    rows = [list(map(int, _DIGITS.findall(PurePosixPath(name).stem))) for name in names]
    if not all(rows):
        return None
    return _counts(rows)


def pattern_of(path: Path) -> Path | None:
    """Make the pattern, such as shot_####.png, of the sequence of a picture; None without a number.

    The number that differs between the files beside it that are named alike is replaced by #.
    """
    runs = list(_DIGITS.finditer(path.stem))
    if not runs:
        return None
    alike = re.compile(r"(\d+)".join(map(re.escape, _DIGITS.split(path.stem))) + re.escape(path.suffix))
    beside = path.parent.iterdir() if path.parent.is_dir() else ()
    rows = [list(map(int, match.groups())) for each in beside if (match := alike.fullmatch(each.name))]
    run = runs[-_counter(rows)] if rows else runs[-1]
    return path.with_name(
        f"{path.stem[: run.start()]}{'#' * len(run[0])}{path.stem[run.end() :]}{path.suffix}"
    )


def frames_of(numbers: Iterable[int]) -> dict[int, int]:
    """Return the frame, as Blender can address it, of each of the increasing numbers in file names.

    They are the same up to `LAST_FRAME`. Where a number is larger, frames count from 1: with the gaps of a
    camera's counter, without gaps where the numbers are times (see `FILLED`).
    """
    numbers = list(numbers)
    if numbers[-1] <= LAST_FRAME:
        return {number: number for number in numbers}
    span = numbers[-1] - numbers[0] + 1
    if len(numbers) >= FILLED * span:
        return {number: number - numbers[0] + 1 for number in numbers}
    return {number: frame for frame, number in enumerate(numbers, 1)}


def blender_shift(files: Sequence[Path], frames: Sequence[int]) -> int | None:
    """Return the difference of the numbers with which Blender looks for the files of frames from the frames.

    None where Blender cannot show the sequence: it takes the last number of the first file's name for the
    counter, and all else in the name as fixed.
    """
    runs = list(_DIGITS.finditer(files[0].stem))
    if not runs:
        return None
    head, tail = files[0].stem[: runs[-1].start()], files[0].name[runs[-1].end() :]
    width, shift = len(runs[-1][0]), int(runs[-1][0]) - frames[0]
    names = (f"{head}{frame + shift:0{width}d}{tail}" for frame in frames)
    if frames[-1] + shift > LARGEST_INT or any(a != b.name for a, b in zip(names, files, strict=True)):
        return None
    return shift


def _counter(rows: list[list[int]]) -> int:
    """Which of the numbers in each name counts the frames, from 1 for the last one."""
    shared = range(1, min(map(len, rows)) + 1)
    values = {place: {row[-place] for row in rows} for place in shared}
    # Frames have different numbers, and those that Blender can address come first.
    return max(shared, key=lambda place: (len(values[place]), max(values[place]) <= LAST_FRAME, -place))


def _counts(rows: list[list[int]]) -> list[int]:
    place = _counter(rows)
    return [row[-place] for row in rows]
