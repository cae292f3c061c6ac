"""Reading clips: video files and image sequences, in their true picture geometry.

Pictures come out as RGB or RGBA with square pixels and upright. Frame numbers are the clip's own: a video's
first picture is frame 1, as in Blender, and a sequence keeps the numbers of its file names, gaps included,
as far as Blender can address them (`sequence.frames_of`).
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from ..base.counting import common_step, ordinal
from ..base.errors import Remedy, UserError
from ..base.file_names import check_name, checked_name
from ..base.regular_file import open_regular, regular_stat
from .colour_space import SRGB
from .exr_parts import read_header
from .fixed_area import FixedArea
from .frame_table import DEFAULT_RATE
from .light import same_colours
from .picture_file import PICTURES, Pixels, full_range, open_picture
from .picture_tags import MOST_ASPECT, PictureTags
from .sequence import LAST_FRAME, clip_files, frames_of, is_pattern, name_numbers, pattern_numbers, pattern_of
from .video import VideoReader, first_frame, video_info
from .video_info import VideoInfo

MOST_STILLS = 100
"""Photos that can be matched each with all others: the pairs take a quarter of a second each."""
DEPTH_MAP = "depth map"
"""Name of a picture with depth beside a clip (`Footage.beside`)."""


@dataclass(frozen=True)
class FrameRange:
    """Frames first to last of the clip, both included, every step-th."""

    first: int
    last: int
    step: int = 1

    def __post_init__(self) -> None:
        """UserError for a step that leads nowhere."""
        if self.step < 1:
            raise UserError(f"the frame step is {self.step}; it must be at least 1")

    def __str__(self) -> str:
        """As `parse` reads it."""
        return f"{self.first}-{self.last}" + (f":{self.step}" if self.step > 1 else "")

    @classmethod
    def parse(cls, text: str) -> FrameRange:
        """Parse "A-B", "A-B:STEP" or "A"; UserError for anything else."""
        match = re.fullmatch(r"(\d{1,18})(?:-(\d{1,18}))?(?::(\d{1,18}))?", text.strip(), re.ASCII)
        if not match:
            raise UserError(f"frames {text!r} are not valid; write A-B, A-B:STEP or a single frame")
        first, last, step = (int(part) if part else None for part in match.groups())
        assert first is not None
        return cls(first, first if last is None else last, 1 if step is None else step)

    def of(self, frames: Iterable[int]) -> tuple[int, ...]:
        """Return the frames of the range, of those given, in their order."""
        return tuple(f for f in frames if self.first <= f <= self.last and (f - self.first) % self.step == 0)


@dataclass(frozen=True)
class Footage:
    """A clip. Hold one open for as long as its frames are read in order: seeking is slow."""

    path: Path
    """The video, the folder, or the pattern, absolute."""
    frames: tuple[int, ...]
    width: int
    """Width of the true picture: square pixels, upright."""
    height: int
    fps: float
    files: tuple[Path, ...] = ()
    """One per frame; empty for a video."""
    numbers: tuple[int, ...] = ()
    """Numbers in the files' names where Blender cannot address them; empty where they are `frames`."""
    video: VideoInfo | None = None
    """Properties of a video: the times of its frames and its sound, and damage."""
    beside: str = ""
    """Name of pictures that lie beside a clip, such as "mask"."""
    is_stills: bool = False
    """Whether the frames are photos in the order of their names, which no time has: of any sizes, `width` and
    `height` being those of the first."""
    pixel_aspect: float = 0.0
    """Width of a stored pixel by its height, if the user has set it; 0 for the file's own."""
    tags: PictureTags = field(default_factory=PictureTags)
    """Those of a sequence's first file."""
    stored: tuple[int, int] = (0, 0)
    """Width and height of it upright, in stored pixels."""
    fixed: FixedArea | None = None
    """Pixels that do not show the scene: frames are read without them."""

    @cached_property
    def _video(self) -> VideoReader:
        return VideoReader(self.path, (self.width, self.height), self.pixel_aspect)

    @cached_property
    def stored_size(self) -> tuple[int, int]:
        """Return width and height of the upright picture in stored pixels, which need not be square."""
        return self.stored if self.files else first_frame(self.path, 1.0)[:2]

    @property
    def is_video(self) -> bool:
        """Return whether it is one file, rather than a picture for each frame."""
        return not self.files

    @property
    def colour_space(self) -> str:
        """The colour space by a video's tags (`colour_space.of_tags`); empty for the default."""
        return self.video.colour_space if self.video is not None else SRGB

    @property
    def notes(self) -> list[str]:
        """Notes on the clip for the user, a line each."""
        found = [] if self.fixed is None else [self.fixed.note]
        if self.video is not None:
            return [*self.video.notes, *found]
        if self.numbers:
            found.append(
                f"the file names count from {self.numbers[0]} to {self.numbers[-1]}, but Blender's last frame"
                f" is {LAST_FRAME}; the clip has {describe(self.frames)} instead"
            )
        if not self.fills_display_window:
            found.append(
                f"the pixels of {self.files[0].name}, its data window, are not all of its display window of"
                f" {self.width}x{self.height}; the rest is empty, and what lies outside is cut off"
            )
        return [*found, *(f"{self.files[0].name}: {note}" for note in self.tags.notes)]

    @cached_property
    def fills_display_window(self) -> bool:
        """Return whether the first picture has exactly the pixels of its whole frame: an EXR may differ."""
        first = self.files[0] if self.files else self.path
        if first.suffix.lower() != ".exr":
            return True
        with contextlib.suppress(OSError, ValueError), open_regular(first) as file:
            part = read_header(file).parts[0]
            return part.data_window == part.display_window
        return True

    @property
    def file_numbers(self) -> tuple[int, ...]:
        """The number in each frame's file name; of a video and of photos the frames' own."""
        return self.numbers or self.frames

    def seconds(self, frame: int) -> float:
        """When a frame is shown, in seconds from a video's frame 1, or from a sequence's first."""
        if self.video is not None:
            return float(self.video.seconds[frame - 1])
        return (frame - self.frames[0]) / self.fps

    def of(self, wanted: FrameRange) -> tuple[int, ...]:
        """Return the frames in a range, which may also count as the files' names do (`numbers`)."""
        named = dict(zip(self.numbers, self.frames, strict=False))
        return wanted.of(self.frames) or tuple(named[number] for number in wanted.of(named))

    def whole(self) -> Footage:
        """Open all frames of the clip that this is a part of."""
        return self.part(None)

    def part(self, frames: FrameRange | Iterable[int] | None, path: Path | None = None) -> Footage:
        """Open frames of the whole clip, or of its copy at a path, in the way that this is opened."""
        ways = self.is_stills, self.beside, self.pixel_aspect
        return open_footage(path or self.path, frames, self.video, *ways)

    def file(self, frame: int) -> Path:
        """Return the file that holds a frame."""
        return self.files[self.frames.index(frame)] if self.files else self.path

    def named(self, name: str) -> int:
        """Return the frame whose file has a name, with or without its suffix; UserError where none has."""
        found = [frame for frame, file in zip(self.frames, self.files, strict=False)
                 if name in (file.name, file.stem)]  # fmt: skip
        if len(found) != 1:
            have = ", ".join(file.name for file in self.files[:10]) + " ..." * (len(self.files) > 10)
            raise UserError(
                f"{self.path.name} has {len(found) or 'no'} pictures {name!r}; it has {have or 'no pictures'}"
            )
        return found[0]

    def read(self, frame: int) -> Pixels:
        """Return (height, width, 3 or 4) RGB or RGBA as stored: uint8, uint16 or float32.

        Raises UserError naming the frame if the clip does not have it, it cannot be decoded, or its size
        is not the clip's; stills have a size each.
        """
        if frame not in self.frames:
            raise UserError(f"{self.path.name} has no frame {frame}; it has {describe(self.frames)}")
        picture = self._video.read(frame) if self.is_video else self._picture(self.file(frame))
        if picture.shape[:2] != (self.height, self.width) and not self.is_stills:
            where = self.file(frame).name if self.files else f"frame {frame}"
            if self.beside:
                raise UserError(
                    f"{where} is {picture.shape[1]}x{picture.shape[0]}, the first {self.beside} is"
                    f" {self.width}x{self.height}; all must have one size and show the whole frame"
                )
            problem = (
                f"{where} is {picture.shape[1]}x{picture.shape[0]}, the clip is {self.width}x{self.height};"
                " all frames of a clip must have one size"
            )
            if self.is_video:
                raise UserError(f"{problem}; choose frames before it", Remedy.FRAMES)
            raise UserError(f"{problem}; unordered photos can be solved as stills", Remedy.STILLS)
        return picture if self.fixed is None else self.fixed.without(picture)

    def _picture(self, file: Path) -> Pixels:
        found = open_picture(file, self.beside == DEPTH_MAP, self.pixel_aspect)
        if self.beside:
            return found.pixels
        if not same_colours(found.tags.colour, self.tags.colour):
            raise UserError(
                f"the colors of {file.name} are stored in another way than those of {self.files[0].name}, as"
                " the files say; convert the pictures to one color space"
            )
        return full_range(found.pixels) if found.tags.is_narrow else found.pixels

    def close(self) -> None:
        """Release the video file."""
        self._video.close()


def open_footage(
    path: Path | str,
    frames: FrameRange | Iterable[int] | None = None,
    info: VideoInfo | None = None,
    stills: bool = False,
    beside: str = "",
    pixel_aspect: float = 0.0,
) -> Footage:
    """Open a video file, a folder of images, or a pattern such as `shot_####.png` or `shot_%04d.png`.

    Args:
        path: The clip.
        frames: Range of frames, or frame numbers.
        info: Known properties of this video, which is decoded completely without them.
        stills: True for a folder of unordered photos; pictures whose names have no numbers are photos, too,
            unless there are more than `MOST_STILLS`.
        beside: Name of pictures beside a clip (`Footage.beside`).
        pixel_aspect: Width of a stored pixel by its height; 0 for the file's own.

    Raises:
        UserError: It cannot be read; the message is one line.
    """
    path = checked_name(_expanded(path))
    if pixel_aspect and not 1 / MOST_ASPECT <= pixel_aspect <= MOST_ASPECT:
        raise UserError(
            f"a pixel aspect of {pixel_aspect:g} cannot be; it is from {1 / MOST_ASPECT:g} to {MOST_ASPECT:g}"
        )
    try:
        if is_pattern(path) or path.is_dir():
            footage = _open_sequence(path, stills, beside, pixel_aspect)
        elif not path.exists():
            raise UserError(
                f"{path} does not exist; choose a video file, a folder of images or a pattern like ####.png"
            )
        elif path.suffix.lower() in PICTURES:
            raise UserError(
                f"{path.name} is a single image; a clip needs several: choose the folder or a pattern"
            )
        else:
            if stills:
                raise UserError(f"{path.name} is not a folder of photos; stills are the images in a folder")
            regular_stat(path)
            info = video_info(path, info)
            numbers = tuple(range(1, info.count + 1))
            size = first_frame(path, pixel_aspect)[:2] if pixel_aspect else (info.width, info.height)
            footage = Footage(
                path, numbers, *size, info.fps, video=info, beside=beside, pixel_aspect=pixel_aspect
            )
    except OSError as error:
        raise UserError(f"{error.filename or path} cannot be read: {error.strerror or error}") from error
    footage = footage if frames is None else _narrowed(footage, frames)
    if footage.frames[-1] > LAST_FRAME:
        raise UserError(
            f"{path.name} has {describe(footage.frames)}, but Blender's last frame is {LAST_FRAME}; choose"
            " frames up to that",
            Remedy.FRAMES,
        )
    if footage.video is not None and (problem := footage.video.other_shape(footage.frames)):
        raise UserError(f"{path.name}: {problem}", Remedy.FRAMES)
    return footage


def _expanded(path: Path | str) -> Path:
    try:
        return Path(path).expanduser().absolute()
    except RuntimeError as error:  # ~ of an unknown user
        raise UserError(f"{path} does not exist: {error}") from None


def describe(frames: Sequence[int]) -> str:
    """Return words for messages: "frames 1 to 118", "every 2nd frame from 1 to 11", or a count of gaps."""
    if (step := common_step(frames)) > 1:
        return f"every {ordinal(step)} frame from {frames[0]} to {frames[-1]}"
    missing = frames[-1] - frames[0] + 1 - len(frames)
    gaps = f" with {missing} missing" if missing else ""
    return f"frames {frames[0]} to {frames[-1]}{gaps}" if len(frames) > 1 else f"frame {frames[0]}"


def _open_sequence(path: Path, stills: bool, beside: str, pixel_aspect: float) -> Footage:
    by_pattern = pattern_numbers(path) if is_pattern(path) else None
    files = clip_files(path) if by_pattern is None else sorted(by_pattern)
    if not files:
        raise UserError(f"{path} has no images; PNG, JPEG, TIFF and EXR are read")
    for file in files:
        check_name(file)
    if by_pattern is None:
        numbers = name_numbers([file.name for file in files])
    else:
        numbers = [by_pattern[file] for file in files]
    stills = stills or (numbers is None and len(files) <= MOST_STILLS)
    if stills or numbers is None:
        numbers = list(range(1, len(files) + 1))
    numbered: dict[int, Path] = {}
    for number, file in zip(numbers, files, strict=True):
        if number in numbered:
            raise UserError(
                f"{numbered[number].name} and {file.name} are both frame {number}; keep one clip per"
                f" folder, or use a pattern like {(pattern_of(file) or file).name}"
            )
        numbered[number] = file
    frames = frames_of(sorted(numbered))
    own = () if all(number == frame for number, frame in frames.items()) else tuple(frames)
    ordered = tuple(numbered[number] for number in frames)
    first = open_picture(ordered[0], beside == DEPTH_MAP, pixel_aspect)
    size, rate = (first.pixels.shape[1], first.pixels.shape[0]), float(DEFAULT_RATE)
    return Footage(
        path, tuple(frames.values()), *size, rate, ordered, own, None, beside, stills, pixel_aspect,
        first.tags, first.size,
    )  # fmt: skip


def _narrowed(footage: Footage, wanted: FrameRange | Iterable[int]) -> Footage:
    if isinstance(wanted, FrameRange):
        kept = footage.of(wanted)
        text = str(wanted)
    else:
        chosen = set(wanted)
        kept = tuple(f for f in footage.frames if f in chosen)
        text = "asked for"
    if not kept:
        raise UserError(f"{footage.path.name} has no frames {text}; it has {describe(footage.frames)}")
    places = dict(zip(footage.frames, footage.files, strict=False))
    numbers = dict(zip(footage.frames, footage.numbers, strict=False))
    files = tuple(places[frame] for frame in kept if places)
    return replace(footage, frames=kept, files=files, numbers=tuple(numbers[f] for f in kept if numbers))
