"""Pictures that lie beside a clip, a depth map or a mask for each frame: which belongs to which."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from ..base.errors import UserError
from .clip import DEPTH_MAP, Footage, describe, open_footage
from .packed_pictures import about_as_many, is_packed, open_packed
from .picture_file import Pixels
from .video_info import is_alike


@dataclass(frozen=True)
class SideFiles:
    """Pictures beside a clip, one for each frame or for some."""

    KIND: ClassVar[str]
    """Name of one of the pictures."""
    WITHOUT: ClassVar[str] = ""
    """Effect on frames without one, at the end of the note that counts them."""

    footage: Footage
    """The clip, or the part of it that was solved."""
    pictures: Footage
    """The pictures beside it, which are read as a clip of their own."""
    numbers: dict[int, int]
    """The clip's frame -> the picture's; frames without a picture are missing."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""

    @classmethod
    def of(cls, path: Path, footage: Footage) -> Self:
        """Open the pictures beside a clip: a folder, a pattern, or one packed file.

        Raises:
            UserError: There are none, or none fits a frame.
        """
        try:
            pictures = (
                open_packed(path, footage, cls.KIND)
                if is_packed(path)
                else open_footage(path, beside=cls.KIND)
            )
        except UserError as error:
            raise UserError(f"{cls.KIND}s: {error}") from error
        numbers, notes = match_frames(pictures, footage, cls.KIND)
        count = len(footage.frames)
        if missing := count - len(numbers):
            notes.append(f"{missing} of {count} frames without a {cls.KIND}{cls.WITHOUT}")
        notes += check_aspect(pictures, footage, cls.KIND)
        return cls(footage, pictures, numbers, tuple(notes))

    def __reduce__(self) -> tuple[object, ...]:
        # Other processes open the files again (`base.parcel`).
        return _opened, (type(self), self.pictures.path, self.footage)

    @property
    def frames(self) -> tuple[int, ...]:
        """The clip's frames that have a picture."""
        return tuple(self.numbers)

    def stored(self, frame: int) -> Pixels:
        """Return the picture (H, W, 3 or 4) of one of `frames`, as `Footage.read`.

        Raises:
            UserError: The file, which is named, cannot be read.
        """
        try:
            return self.pictures.read(self.numbers[frame])
        except UserError as error:
            raise UserError(f"{self.KIND}s: {error}") from error


def _opened[S: SideFiles](kind: type[S], path: Path, footage: Footage) -> S:
    return kind.of(path, footage)


def match_frames(pictures: Footage, clip: Footage, kind: str) -> tuple[dict[int, int], list[str]]:
    """Match the pictures beside a clip to its frames.

    If there are as many as the clip has frames, or as many as were solved, they belong to those by the
    numbers in their names or, where these are others, in order. A video of the clip's length at another rate
    is matched by time. Other counts are matched by the numbers alone. Numbers from 0 are those of a clip
    from 1. Other counts of depth maps, which programs write, and of videos are refused where the numbers just
    count from 0 or 1: they may be those of every second frame.

    Args:
        pictures: The pictures, opened as a clip.
        clip: The clip, or the part of it that was solved.
        kind: What one picture is called in messages, such as "depth map".

    Returns:
        The clip's frame -> that of its picture, frames without one missing; and notes for the user.

    Raises:
        UserError: if no picture belongs to a frame, or it is not clear which ones do.
    """
    whole, count, notes = clip.whole(), len(pictures.frames), list[str]()
    timed = {} if count == len(whole.frames) else _by_time(pictures, whole)
    part = next((each for each in (whole, clip) if len(each.frames) == count and not timed), None)
    numbers = timed or _by_name(pictures, part or whole, whole.file_numbers[0])
    if timed:
        notes.append(f"{kind}s are matched by time: {count} for the clip's {len(whole.frames)} frames")
    elif part is None:
        is_written = kind == DEPTH_MAP or pictures.video is not None
        if is_written and _only_counts(pictures.file_numbers, whole):
            raise UserError(_unclear(pictures, whole, kind))
        if unused := count - len(set(numbers.values())):
            notes.append(f"{unused} of {count} {kind}s belong to no frame of the clip")
    elif len(numbers) < count:
        numbers = dict(zip(part.frames, pictures.frames, strict=True))
        notes.append(
            f"{kind}s belong to the clip in order: {pictures.path.name} has"
            f" {describe(pictures.file_numbers)}, the clip {describe(part.file_numbers)}"
        )
    numbers = {frame: numbers[frame] for frame in clip.frames if frame in numbers}
    if not numbers:
        short = kind.split()[-1]
        raise UserError(
            f"no {kind} in {pictures.path.name} belongs to the clip: the {short}s are"
            f" {describe(pictures.file_numbers)}, the clip has {describe(clip.file_numbers)}; number them"
            f" like the clip, or provide one {short} for every frame"
        )
    return numbers, notes


def _by_name(pictures: Footage, clip: Footage, first: int) -> dict[int, int]:
    """A clip's frame -> that of the picture whose name has its number; the whole clip begins at `first`."""
    shifted = 1 if pictures.file_numbers[0] == 0 and first == 1 else 0
    named = dict(zip(pictures.file_numbers, pictures.frames, strict=True))
    ways = (clip.file_numbers, clip.frames) if clip.numbers else (clip.frames,)
    found = [
        {frame: named[number - shifted] for frame, number in zip(clip.frames, way, strict=True)
         if number - shifted in named}
        for way in ways
    ]  # fmt: skip
    return max(found, key=len)


def _by_time(pictures: Footage, clip: Footage) -> dict[int, int]:
    """A video's frame -> the one of another video that is shown then; empty unless both are equally long."""
    if pictures.video is None or clip.video is None:
        return {}
    theirs, ours = pictures.video.seconds, clip.video.seconds
    slower = 1 / min(pictures.fps, clip.fps)
    if abs(theirs[-1] + 1 / pictures.fps - ours[-1] - 1 / clip.fps) > slower:
        return {}
    nearest = np.abs(ours[:, None] - theirs).argmin(axis=1)
    is_shown = np.abs(ours - theirs[nearest]) <= 0.5 / clip.fps
    return {int(frame) + 1: int(nearest[frame]) + 1 for frame in np.flatnonzero(is_shown)}


def _only_counts(numbers: tuple[int, ...], clip: Footage) -> bool:
    """Whether several numbers count pictures, from 0 or 1, and are too few or many for all frames."""
    is_count = len(numbers) > 1 and numbers[0] in (0, 1) and numbers[-1] - numbers[0] + 1 == len(numbers)
    return is_count and not about_as_many(len(numbers), len(clip.frames))


def _unclear(pictures: Footage, clip: Footage, kind: str) -> str:
    count, numbers = len(pictures.frames), pictures.file_numbers
    return (
        f"{pictures.path.name} has {count} {kind}s, numbered {numbers[0]} to {numbers[-1]}, and the clip"
        f" {len(clip.frames)} frames: it is not clear which they belong to. Provide one for every frame, or"
        " number each like its frame, as 1, 3, 5 for every second one"
    )


def check_aspect(pictures: Footage, clip: Footage, kind: str) -> list[str]:
    """Check that the pictures beside a clip have its shape, with a note where they are stretched over it.

    Raises UserError for depth maps that were cropped or padded: one side is the clip's, the other is not.
    """
    own, shown = (pictures.width, pictures.height), (clip.width, clip.height)
    is_whole, is_cut = is_alike(*own, *shown), (own[0] == shown[0]) != (own[1] == shown[1])
    # Programs that know of no pixels but square ones make them of the stored pictures.
    if (is_whole and not is_cut) or is_alike(*own, *clip.stored_size):
        return []
    size, whole = (f"{each.width}x{each.height}" for each in (pictures, clip))
    if is_cut and not is_whole and kind == DEPTH_MAP:
        raise UserError(
            f"the {kind}s are {size}, the clip is {whole}: they were cropped or padded. Maps of any size are"
            " accepted, but each must show the whole frame"
        )
    return [f"the {kind}s are {size}, stretched over {whole}; each should show the whole frame"]
