"""Depth maps that other programs pack into one file: an array of .npz, or pictures in a .zip."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ..base.errors import UserError
from ..base.lru_cache import remembered
from ..base.npz import ArrayFile
from ..base.regular_file import open_regular
from .clip import DEPTH_MAP, Footage
from .picture_file import ARRAY, ARRAYS, PICTURES, Pixels, decode_picture, grey
from .sequence import is_litter, is_pattern, name_numbers

PACKED = (ARRAY, ".zip")
"""Endings of the files that are read."""
MOST = 256 << 20
"""Bytes of one picture of a .zip as it is unpacked, of 8192 x 8192 floats, and of all that are remembered:
maps of frames around one are asked for again."""
MISCOUNTED = 2
"""Frames by which programs disagree on how many a video has."""
LEAST_SHARE = 0.9
"""Share of the frames of a short clip that makes the same difference no other rate."""


@dataclass(frozen=True)
class PackedPictures(Footage):
    """Pictures in one file, numbered as the frames that they belong to."""

    decode: Callable[[int], Pixels] = field(kw_only=True, repr=False, compare=False)
    """A frame's picture from the file; OSError or ValueError where it cannot be read."""

    @remembered(MOST, lambda picture: picture.nbytes)
    def read(self, frame: int) -> Pixels:
        """Return a picture (h, w, 3 or 4) of one of `frames` as stored, float32 for arrays.

        Raises:
            UserError: It is damaged.
        """
        return _readable(self.path, self.decode, frame)


def is_packed(path: Path) -> bool:
    """Return whether a path has the ending of such a file, and is neither a folder nor a pattern."""
    return path.suffix.lower() in PACKED and not path.is_dir() and not is_pattern(path)


def open_packed(path: Path, clip: Footage, beside: str = "") -> PackedPictures:
    """Open the pictures of a file for an open clip.

    They are the maps of an .npz, of which the first one belongs to the clip's first frame, or the pictures of
    a .zip, numbered by their names. Raises UserError of one line if it cannot be read, or has no pictures.
    """
    try:
        if path.suffix.lower() == ".zip":
            numbers, decode = _zipped(path, beside == DEPTH_MAP)
        else:
            numbers, decode = _stacked(path, clip)
    except (OSError, ValueError) as error:
        raise UserError(f"{path.name} cannot be read: {_reason(error)}") from error
    first = _readable(path, decode, numbers[0])
    size = first.shape[1], first.shape[0]
    return PackedPictures(path, numbers, *size, clip.fps, beside=beside, decode=decode)


def about_as_many(one: int, other: int) -> bool:
    """Return whether two counts of a clip's frames differ by no more than programs disagree on."""
    few, many = sorted((one, other))
    return many - few <= MISCOUNTED and few >= LEAST_SHARE * many


def _stacked(path: Path, clip: Footage) -> tuple[tuple[int, ...], Callable[[int], Pixels]]:
    array, whole = ArrayFile(path, ARRAYS), clip.whole()
    numbers = next((part.frames for part in (whole, clip) if len(part.frames) == array.count), ())
    if not numbers and about_as_many(array.count, len(whole.frames)):
        numbers = whole.frames[: array.count]
    if not numbers:
        raise ValueError(
            f"it has {array.count} maps and the clip {len(whole.frames)} frames: it is not clear which they"
            " belong to; make one for every frame, or save each as a file with its frame's number, as"
            " depth_0001.npz"
        )
    place = {number: index for index, number in enumerate(numbers)}
    return numbers, lambda frame: grey(array.read(place[frame]))


def _zipped(path: Path, is_depth: bool) -> tuple[tuple[int, ...], Callable[[int], Pixels]]:
    members = dict[int, str]()
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            names = [
                name for name in archive.namelist()
                if Path(name).suffix.lower() in PICTURES and not is_litter(name)
            ]  # fmt: skip
    except zipfile.BadZipFile as error:
        raise ValueError(error) from None
    if not names:
        raise ValueError(f"it has no pictures; {', '.join(PICTURES)} are read")
    numbers = name_numbers(names)
    if numbers is None:
        name = next(name for name in names if name_numbers([name]) is None)
        raise ValueError(f"{name} in it has no frame number; name it like 00012.exr")
    for name, number in zip(names, numbers, strict=True):
        if number in members:
            raise ValueError(
                f"{members[number]} and {name} in it are both frame {number}; give each a number of its own,"
                " like 00012.exr"
            )
        members[number] = name

    def decode(frame: int) -> Pixels:
        name = members[frame]
        try:
            with open_regular(path) as file, zipfile.ZipFile(file) as archive:
                if archive.getinfo(name).file_size > MOST:
                    raise ValueError(f"{name} in it is larger than {MOST >> 20} MB")
                data = archive.read(name)
        except (zipfile.BadZipFile, KeyError, EOFError, RuntimeError, NotImplementedError) as error:
            raise ValueError(f"{name} in it is damaged: {error}") from None
        return decode_picture(data, name, is_depth)

    return tuple(sorted(members)), decode


def _readable(path: Path, decode: Callable[[int], Pixels], frame: int) -> Pixels:
    try:
        return decode(frame)
    except (OSError, ValueError) as error:
        raise UserError(f"frame {frame} of {path.name} cannot be read: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    return str((error.strerror if isinstance(error, OSError) else None) or error)
