"""Pictures that lie beside a clip, a depth map or a mask for each frame: which belongs to which."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

from ..base.errors import UserError
from .clip import Footage, describe, open_footage
from .packed_pictures import is_packed, open_packed
from .picture_file import Pixels

STRETCH = 0.02
"""By which their shape may differ from the clip's before a note says so."""


@dataclass(frozen=True)
class SideFiles:
    """Pictures beside a clip, one for each frame or for some."""

    KIND: ClassVar[str]
    """What one of them is called."""
    WITHOUT: ClassVar[str] = ""
    """What becomes of frames without one, at the end of the note that counts them."""

    footage: Footage
    """The clip."""
    pictures: Footage
    """The pictures beside it, which are read as a clip of their own."""
    numbers: dict[int, int]
    """The clip's frame -> the picture's; frames without a picture are missing."""
    notes: tuple[str, ...] = ()
    """What the user should know."""

    @classmethod
    def of(cls, path: Path, footage: Footage) -> Self:
        """The pictures of a clip in a folder, of a pattern, or packed into one file; UserError where there
        are none or none fits a frame."""
        try:
            pictures = open_packed(path, footage) if is_packed(path) else open_footage(path)
        except UserError as error:
            raise UserError(f"{cls.KIND}s: {error}") from error
        numbers, notes = match_frames(pictures, footage, cls.KIND)
        count = len(footage.frames)
        if missing := count - len(numbers):
            notes.append(f"{missing} of {count} frames without a {cls.KIND}{cls.WITHOUT}")
        notes += check_aspect(pictures, footage, cls.KIND)
        return cls(footage, pictures, numbers, tuple(notes))

    @property
    def frames(self) -> tuple[int, ...]:
        """The clip's frames that have a picture."""
        return tuple(self.numbers)

    def stored(self, frame: int) -> Pixels:
        """The picture (H, W, 3 or 4) of one of `frames`, as `Footage.read`; UserError naming the file where
        it cannot be read."""
        try:
            return self.pictures.read(self.numbers[frame])
        except UserError as error:
            raise UserError(f"{self.KIND}s: {error}") from error


def match_frames(pictures: Footage, clip: Footage, kind: str) -> tuple[dict[int, int], list[str]]:
    """The clip's frame -> that of its picture, frames without one missing; and what the user should know.

    They belong to the frames that their names number. Where these are not the clip's numbers but the counts
    agree, they belong to the frames in order. A video's first frame is 1; pictures that begin at 0 begin
    there. `kind` names one, as "depth map". UserError where none fits a frame.
    """
    frames, notes = pictures.frames, []
    shifted = 1 if clip.is_video and frames[0] == 0 else 0
    named = dict(zip(pictures.file_numbers, frames, strict=True))
    ways = (clip.file_numbers, clip.frames) if clip.numbers else (clip.frames,)
    found = [
        {frame: named[number - shifted] for frame, number in zip(clip.frames, way, strict=True)
         if number - shifted in named}
        for way in ways
    ]  # fmt: skip
    numbers = max(found, key=len)
    if len(numbers) < len(clip.frames) == len(frames):
        numbers = dict(zip(clip.frames, frames, strict=True))
        notes.append(
            f"{kind}s belong to the clip in order: {pictures.path.name} has {describe(frames)},"
            f" the clip {describe(clip.frames)}"
        )
    if not numbers:
        short = kind.split()[-1]
        raise UserError(
            f"no {kind} in {pictures.path.name} belongs to the clip: the {short}s are"
            f" {describe(pictures.file_numbers)}, the clip has {describe(clip.file_numbers)}; number them"
            f" like the clip, or provide one {short} for every frame"
        )
    return numbers, notes


def check_aspect(pictures: Footage, clip: Footage, kind: str) -> list[str]:
    """What the user should know where they have another shape than the clip."""
    if abs(pictures.width * clip.height / (pictures.height * clip.width) - 1) <= STRETCH:
        return []
    return [f"the {kind}s are {pictures.width}x{pictures.height}, stretched over {clip.width}x{clip.height}"]
