"""Reading videos with FFmpeg (PyAV): a table of frames, times and damage made once, then frames by number.

PyAV, not OpenCV's FFmpeg, because it gives packets, times, the decoder's errors, more bits and AV1. Measured
with PyAV 19.0.2 and OpenCV 5.0.0: import 0.10 s and 10 MB; 118 frames of 1920x1080 decoded in 1.3 s by both;
8-bit pictures of H.264, HEVC, VP9, MJPEG, MPEG-4, FFV1, PNG and GIF equal to the last bit. It reads, Blender
reads and writes movies, in one process with bpy 5.2.3 and Debian's Blender 5.2.2, loaded before or after. The
wheels are 19 to 35 MB, one a platform for Python 3.12 and later: a fifth of the extension's zip (181 MB on
Linux, 131 on Windows, 116 on macOS), for clips that are read right.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.video.frame import VideoFrame
from av.video.stream import VideoStream
from numpy.typing import NDArray

from ..base import memory
from ..base.counting import ranges
from ..base.errors import Remedy, UserError
from ..base.progress import checkpoint
from .colour_space import of_tags
from .container import open_video
from .frame_table import FrameTable, read_table
from .picture_file import Pixels

MISSING = 0.02
"""Share of a clip's frames that may be missing at its end, with a word, before it is refused as truncated."""
LATE = 1.5
"""Of the median time between frames: with one frame less between two, they are twice as far apart."""
GAPS = 0.1
"""Share of a clip's frames up to which late frames are reported; with more, the rate is what varies."""
NAMED = 20
"""Such frames that are named; one recorder leaves out hundreds."""


_LUMA = {1: (0.2126, 0.0722), 5: (0.299, 0.114), 6: (0.299, 0.114), 9: (0.2627, 0.0593), 10: (0.2627, 0.0593)}
"""Weights of red and blue in luma by the code of matrix coefficients (ITU-T H.273, table 4)."""
_FULL = 2
"""FFmpeg's code of a range that uses all values."""


@dataclass(frozen=True)
class VideoInfo:
    """What is known of a video once it was decoded to its end, which takes milliseconds a frame."""

    width: int
    """Pixels across of the upright picture with square pixels."""
    height: int
    """Pixels down of the upright picture with square pixels."""
    fps: float
    """Frames a second: the rate that all frames keep, or the mean where there is none."""
    tick: tuple[int, int]
    """Seconds of a unit of time, as a fraction."""
    times: tuple[int, ...]
    """When each frame is shown, in ticks, increasing."""
    is_timed: bool
    """Whether the file holds the times; else they are the rate's."""
    keys: tuple[int, ...]
    """Numbers of the frames at which decoding may begin; only 1 where seeking is not exact."""
    sound: float | None
    """Seconds from the first frame until the sound begins, below 0 where it is first; None without sound."""
    damaged: tuple[int, ...]
    """Numbers of the frames that the decoder found damaged: it made up a part of them, or all."""
    missing: int
    """Frames that the file promises past its end."""
    colour_space: str
    """By its tags, as Blender names it (`colour_space.of_tags`)."""

    @classmethod
    def parse(cls, kept: Any) -> VideoInfo | None:
        """From the object that a file kept of it; None where there is none or it cannot be."""
        try:
            info = cls(
                int(kept["width"]), int(kept["height"]), float(kept["fps"]),
                (int(kept["tick"][0]), int(kept["tick"][1])), tuple(map(int, kept["times"])),
                bool(kept["is_timed"]), tuple(map(int, kept["keys"])),
                None if kept["sound"] is None else float(kept["sound"]),
                tuple(map(int, kept["damaged"])), int(kept["missing"]), str(kept["colour_space"]),
            )  # fmt: skip
        except (KeyError, TypeError, ValueError, OverflowError, IndexError):
            return None
        return info if info._is_possible() else None

    def _is_possible(self) -> bool:
        in_clip = all(1 <= frame <= self.count for frame in self.keys + self.damaged)
        rises = all(a < b for a, b in zip(self.times, self.times[1:], strict=False))
        sizes = min(self.count, self.width, self.height, *self.tick) > 0 and 0 < self.fps < 1000
        return sizes and in_clip and rises and self.keys[:1] == (1,) and 0 <= self.missing <= self.count

    @property
    def count(self) -> int:
        """Frames that can be shown."""
        return len(self.times)

    @cached_property
    def seconds(self) -> NDArray[np.float64]:
        """(count,) when each frame is shown, in seconds from the first."""
        ticks = np.array(self.times, dtype=np.int64)
        return np.asarray((ticks - ticks[0]) * (self.tick[0] / self.tick[1]), np.float64)

    @cached_property
    def is_variable(self) -> bool:
        """Whether some frame is shown half a frame or more from where a constant rate would show it."""
        return not keeps_rate(self.seconds, self.fps)

    def _gaps(self) -> list[int]:
        """Numbers of the frames after which the next comes late, where most come evenly."""
        apart = np.diff(self.seconds)
        late = apart > LATE * np.median(apart)
        return (1 + np.flatnonzero(late)).tolist() if late.sum() <= GAPS * len(late) else []

    @property
    def notes(self) -> list[str]:
        """What the user should know of the clip, a line each."""
        notes = []
        if self.damaged:
            one = len(self.damaged) == 1
            notes.append(
                f"{'frame' if one else 'frames'} {ranges(list(self.damaged))} of the clip"
                f" {'is' if one else 'are'} damaged in the file: part of the picture is wrong, and nearby"
                " frames may be, too; copy the clip again or leave them out"
            )
        if self.missing:
            claimed = self.count + self.missing
            lost = ranges(list(range(self.count + 1, claimed + 1)))
            notes.append(
                f"{'frame' if self.missing == 1 else 'frames'} {lost} of {claimed} cannot be read: the end"
                " of the clip is missing; copy it again"
            )
        if gaps := self._gaps():
            more = f" and {len(gaps) - NAMED} more" if len(gaps) > NAMED else ""
            named = f"{'frame' if len(gaps) == 1 else 'frames'} {ranges(gaps[:NAMED])}{more}"
            notes.append(f"after {named} of the clip there is a gap: frames were dropped or lost there")
        if self.is_variable:
            notes.append(
                "the clip has a variable frame rate: movies from the command line keep each frame's time,"
                f" but the timeline and image sequences run at {self.fps:.4g} frames a second, so sound"
                " drifts there"
            )
        return notes


def keeps_rate(seconds: NDArray[np.float64], fps: float) -> bool:
    """Whether frames shown at `seconds` (n,) are all less than half a frame from a constant rate's.

    That begins with the first frame, against which sound is set.
    """
    off = (seconds - seconds[:1]) * fps - np.arange(len(seconds))
    return bool(np.all(np.abs(off) < 0.5 - 1e-6))


_known: dict[tuple[str, int, int, int], VideoInfo] = {}
"""By path, size in bytes, and times of modification and change in ns: an unchanged file is decoded once."""


def video_info(path: Path, known: VideoInfo | None = None) -> VideoInfo:
    """What is known of a video: `known`, which is kept for later calls, or found by decoding all of it once.

    UserError where it cannot be read or is truncated.
    """
    state = path.stat()
    key = str(path), state.st_size, state.st_mtime_ns, state.st_ctime_ns
    if known is not None:
        _known[key] = known
    elif key not in _known:
        if state.st_size == 0:
            raise UserError(f"{path.name} is empty (0 bytes); copy it again from the camera")
        try:
            _known[key] = _decode_all(path)
        except (av.FFmpegError, MemoryError) as error:
            raise memory.shortage(f"{path.name} cannot be decoded") from error
    return _known[key]


class VideoReader:
    """An open video whose frames are read by number, exactly; in order is cheapest.

    A frame that is not soon to come is sought from the key frame before it. Where the container has no index
    of those, decoding begins anew.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._container: InputContainer | None = None
        self._frames: Iterable[VideoFrame] = ()
        self._last = 0
        """Number of the frame that was decoded last; 0 before the first."""

    def read(self, frame: int) -> Pixels:
        """(H, W, 3) RGB of a frame, from 1 on: uint8, or uint16 of a video with more than 8 bits. UserError
        where it cannot be decoded."""
        info = video_info(self._path)
        key = max(number for number in info.keys if number <= frame)
        if self._container is None or frame <= self._last or key > self._last + 1:
            self._begin(info, key)
        found = self._decode_to(info, frame)
        if found is None and self._container is not None and key > 1:
            # Not every container's index leads where it says.
            self._begin(info, 1)
            found = self._decode_to(info, frame)
        if found is None:
            self.close()
            if memory.is_scarce():
                raise memory.shortage(f"frame {frame} of {self._path.name} cannot be decoded")
            raise UserError(
                f"frame {frame} of {self._path.name} cannot be decoded; the file may be cut off: convert it"
                " again or leave the frame out",
                Remedy.FRAMES,
            )
        assert self._container is not None
        return upright(found, self._container.streams.best("video"))  # type: ignore[arg-type]

    def close(self) -> None:
        """Release the file; the next read opens it again."""
        if self._container is not None:
            self._frames = ()
            self._container.close()
            self._container, self._last = None, 0

    def _begin(self, info: VideoInfo, key: int) -> None:
        """Have the frames from a key frame on come next."""
        if self._container is None or key == 1:
            self.close()
            self._container, stream = open_video(self._path)
            stream.thread_type = "AUTO"
        else:
            stream = self._container.streams.best("video")  # type: ignore[assignment]
        if key > 1:
            self._container.seek(info.times[key - 1], stream=stream)
        self._last = key - 1
        self._frames = _decoded(self._container, stream)

    def _decode_to(self, info: VideoInfo, frame: int) -> VideoFrame | None:
        """Decode up to a frame; None where the file ends before, or goes on after it."""
        wanted = info.times[frame - 1]
        for found in self._frames:
            checkpoint()
            self._last += 1
            if info.is_timed and found.pts is not None:
                if found.pts > wanted:
                    return None
                if found.pts < wanted:
                    continue
                self._last = frame
            if self._last == frame:
                return found
        return None


def _decoded(container: InputContainer, stream: VideoStream) -> Iterable[VideoFrame]:
    """Frames as they are shown; packets that cannot be decoded give none."""
    for packet in container.demux(stream):
        try:
            yield from packet.decode()
        except av.FFmpegError:
            if memory.is_scarce():
                return


def upright(frame: VideoFrame, stream: VideoStream) -> Pixels:
    """(H, W, 3) RGB of a decoded frame, turned as the file says, with square pixels: uint8, or uint16 of one
    with more than 8 bits, of its full range."""
    if any(component.bits > 8 for component in frame.format.components):
        picture: Pixels = _deep_rgb(frame)
    else:
        # Bicubic, of the planes of colour, too: what OpenCV and FFmpeg's own program use.
        picture = np.asarray(frame.to_ndarray(format="rgb24", interpolation="BICUBIC", threads=1), np.uint8)
    turns = round(frame.rotation / 90) % 4
    across, down = 1, 1
    if ratio := stream.sample_aspect_ratio:
        across, down = ratio.numerator, ratio.denominator
    if turns:
        picture = np.ascontiguousarray(np.rot90(picture, turns))  # type: ignore[assignment]
    if across <= 0 or down <= 0 or across == down:
        return picture
    height, width = picture.shape[:2]
    # A clip that is shown on its side has its stored width upright.
    size = (width, round(height * across / down)) if turns % 2 else (round(width * across / down), height)
    shrinks = size[0] * size[1] < width * height
    resized: Pixels = cv2.resize(  # type: ignore[assignment]
        picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    )
    return resized


def _deep_rgb(frame: VideoFrame) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 RGB of a decoded frame with more than 8 bits, of its full range.

    By floats: FFmpeg's own conversion to 16 bits leaves white at 65283 of 65535, in PQ a twentieth of the
    light.
    """
    if frame.format.is_rgb or len(frame.format.components) < 3:
        return np.asarray(frame.to_ndarray(format="rgb48le", interpolation="BICUBIC", threads=1), np.uint16)
    planes = frame.to_ndarray(format="yuv444p16le", interpolation="BICUBIC", threads=1)
    red, blue = _LUMA.get(frame.colorspace, _LUMA[1])
    green = 1 - red - blue
    # Limited ranges are 219 and 224 of 256 (ITU-T H.273, 8.3). A full one FFmpeg spreads over all 16 bits in
    # luma, and moves up in the others, as seen in what it makes of known values.
    chroma = 65536 - (1 << (16 - frame.format.components[1].bits))
    full = frame.color_range == _FULL
    scale = np.array([65535, chroma, chroma] if full else [219 << 8, 224 << 8, 224 << 8], np.float64)
    matrix = np.array([
        [1, 0, 2 - 2 * red],
        [1, -blue * (2 - 2 * blue) / green, -red * (2 - 2 * red) / green],
        [1, 2 - 2 * blue, 0],
    ]) * (65535 / scale)  # fmt: skip
    offset = -matrix @ np.array([0 if full else 4096, 32768, 32768])
    rgb = cv2.transform(planes.astype(np.float32), np.column_stack([matrix, offset]).astype(np.float32))
    return np.asarray(np.clip(rgb, 0, 65535) + 0.5, np.uint16)


def _decode_all(path: Path) -> VideoInfo:
    table = read_table(path)
    if not table.times:
        if memory.is_scarce():
            raise memory.shortage(f"{path.name} cannot be decoded")
        raise UserError(f"{path.name} has no frame that can be decoded; convert it to H.264 and try again")
    claimed = len(table.times) + table.missing
    if table.missing > MISSING * claimed:
        if memory.is_scarce():
            raise memory.shortage(f"{path.name} cannot be decoded to its end")
        raise UserError(
            f"{path.name} is cut off: frame {len(table.times) + 1} of {claimed} cannot be decoded; copy or"
            " convert it again"
        )
    return _info(table, *first_frame(path))


def first_frame(path: Path) -> tuple[int, int, str]:
    """Width and height of a video's first frame as it is shown, and its colour space by its tags; UserError
    where it cannot be decoded."""
    container, stream = open_video(path)
    with container:
        for frame in _decoded(container, stream):
            height, width = upright(frame, stream).shape[:2]
            return width, height, of_tags(frame.color_trc, frame.color_primaries)
    raise UserError(f"{path.name} has no frame that can be decoded; convert it to H.264 and try again")


def _info(table: FrameTable, width: int, height: int, colour_space: str) -> VideoInfo:
    tick = Fraction(*table.tick)
    times, is_timed = table.times, table.is_timed
    if not is_timed:
        # Frames follow each other at the rate, one tick each.
        times, tick = tuple(range(len(times))), 1 / table.rates[0]
    seconds = np.array([float((time - times[0]) * tick) for time in times])
    fps = next((float(rate) for rate in table.rates if keeps_rate(seconds, float(rate))), 0.0)
    if not fps:
        fps = (len(seconds) - 1) / seconds[-1] if len(seconds) > 1 else float(table.rates[0])
    return VideoInfo(
        width, height, float(min(fps, 999.0)), (tick.numerator, tick.denominator), times, is_timed,
        table.keys, table.sound, table.damaged, table.missing, colour_space,
    )  # fmt: skip
