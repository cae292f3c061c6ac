"""Properties of a completely decoded video, and notes on it for the user."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.counting import ranges
from .constant_rate import fitting_rate, keeps_rate, largest_shift
from .video_frame import BlenderView

LATE = 1.5
"""Ratio to the median frame interval from which a frame is late: one dropped frame doubles the interval."""
GAPS = 0.1
"""Share of late frames up to which they are reported; with more, the rate varies."""
NAMED = 20
"""Such frames that are named; one recorder leaves out hundreds."""
SAME_SHAPE = 0.02
"""Relative difference of two aspects that comes of rounding to whole blocks of 8 pixels, at 360 rows."""


@dataclass(frozen=True)
class VideoInfo:
    """Properties of a completely decoded video; decoding takes milliseconds a frame."""

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
    """True if the file holds the times; else they follow from the rate."""
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
    view: BlenderView
    """How Blender's own picture of it differs."""
    sound_track: int
    """Place of the sound among the tracks of sound: the first one that can be decoded."""
    sizes: tuple[tuple[int, int, int], ...]
    """Where the size of the stored pictures begins or changes: frame number, width and height in pixels."""
    remarks: tuple[str, ...]
    """Other notes for the user, a line each."""

    @classmethod
    def parse(cls, kept: Any) -> VideoInfo | None:
        """Read the object that a file kept of it; None if it is missing or invalid."""
        try:
            info = cls(
                int(kept["width"]), int(kept["height"]), float(kept["fps"]),
                (int(kept["tick"][0]), int(kept["tick"][1])), tuple(map(int, kept["times"])),
                bool(kept["is_timed"]), tuple(map(int, kept["keys"])),
                None if kept["sound"] is None else float(kept["sound"]),
                tuple(map(int, kept["damaged"])), int(kept["missing"]), str(kept["colour_space"]),
                BlenderView(kept["view"]), int(kept["sound_track"]),
                tuple((int(at), int(across), int(down)) for at, across, down in kept["sizes"]),
                tuple(map(str, kept["remarks"])),
            )  # fmt: skip
        except (KeyError, TypeError, ValueError, OverflowError, IndexError):
            return None
        return info if info._is_possible() else None

    def _is_possible(self) -> bool:
        in_clip = all(1 <= frame <= self.count for frame in self.keys + self.damaged)
        rises = all(a < b for a, b in zip(self.times, self.times[1:], strict=False))
        stored = all(1 <= frame <= self.count and min(size) > 0 for frame, *size in self.sizes)
        sizes = min(self.count, self.width, self.height, *self.tick) > 0 and 0 < self.fps < np.inf
        begins = self.keys[:1] == (1,) and [frame for frame, _, _ in self.sizes[:1]] == [1]
        counts = 0 <= self.missing <= self.count and self.sound_track >= 0
        return sizes and stored and in_clip and rises and begins and counts

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
        """Return whether some frame is at least half a frame off a constant rate."""
        return not keeps_rate(self.seconds, self.fps)

    @cached_property
    def movie_rate(self) -> float:
        """Frames a second of a movie with a place for every frame."""
        return fitting_rate(self.seconds) if self.is_variable else self.fps

    def other_shape(self, frames: Sequence[int]) -> str:
        """Return the reason why frames are not one clip: pictures of different shapes; else ""."""
        begins = [frame for frame, _, _ in self.sizes]
        _, across, down = self.sizes[0]
        for frame in frames:
            begin, width, height = self.sizes[bisect_right(begins, frame) - 1]
            if not is_alike(width, height, across, down):
                return (
                    f"the picture changes from {across}x{down} to {width}x{height} pixels at frame {begin};"
                    " choose frames before it, or cut the clip there"
                )
        return ""

    def _gaps(self) -> list[int]:
        """Numbers of the frames after which the next comes late, where most come evenly."""
        apart = np.diff(self.seconds)
        late = apart > LATE * np.median(apart)
        return (1 + np.flatnonzero(late)).tolist() if late.sum() <= GAPS * len(late) else []

    @property
    def notes(self) -> list[str]:
        """Notes on the clip for the user, a line each."""
        notes = list(self.remarks)
        if len(self.sizes) > 1:
            scaled = ", ".join(
                f"{width}x{height} from frame {at}" for at, width, height in self.sizes[:NAMED]
            )
            notes.append(
                f"the stored pictures change their size ({scaled}); they are scaled to that of the first one"
            )
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
            shift = largest_shift(self.seconds, self.movie_rate)
            off = "" if shift * self.movie_rate <= 1 else f" to {shift:.2g} s"
            notes.append(
                f"the clip has a variable frame rate: movies keep each frame's time{off},"
                f" but the timeline and image sequences run at {self.fps:.4g} frames a second, so sound"
                " drifts there"
            )
        return notes


def is_alike(width: int, height: int, across: int, down: int) -> bool:
    """Return whether two sizes in pixels have the same shape, but for rounding."""
    return abs(width * down / (height * across) - 1) < SAME_SHAPE
