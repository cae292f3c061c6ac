"""Frames of an animation that other processes draw ahead of Blender's render.

Blender renders an animation's frames one after the other in one process, in which a second processor hardly
helps. Other processes therefore open a copy of the file and draw later frames, each in one thread. The
engine takes finished frames, waits for a frame in progress, and draws the rest: the first frame, and all of
them if the others fail.

FOLDER/scene.blend               the file, as it was when the animation began
FOLDER/at                        the number of the frame that Blender is at; only later ones are drawn ahead
FOLDER/frame-000012.lock         held by the process that draws the frame
FOLDER/frame-000012              the drawn frame
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from ...core.base import limits
from ...core.base.arrays import LinearRGBA
from ...core.base.atomic import hand_over, temporary_folder
from ...core.base.errors import UserError
from ...core.base.file_lock import claimed
from ...core.base.job import Job, end_meanwhile
from ...core.base.parcel import pack, unpack
from ...core.base.progress import checkpoint
from ...scene.base.events import RENDERS, at
from ...scene.gpu import main_thread
from . import jobs
from .launcher import start, write_blend

LOOK = 0.02
"""Seconds between two looks for a frame that another process draws."""
WAITING = 2
"""Frames for each process that may wait to be taken: those of 4K take 130 MB of disk each."""


@dataclass(frozen=True)
class DrawnFrame:
    """A frame as the engine draws it."""

    pictures: dict[str, LinearRGBA]
    """(H, W, 4) linear, premultiplied, of the pass Combined, and (H, W, 1) of others, by name; float32."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""


@dataclass(frozen=True)
class SharedFrames:
    """The folder by which processes share an animation's frames."""

    folder: Path

    @property
    def blend(self) -> Path:
        """The .blend that all of them draw from."""
        return self.folder / "scene.blend"

    @property
    def at(self) -> int | None:
        """The frame that Blender is at; None before its first."""
        with contextlib.suppress(OSError, ValueError):
            return int((self.folder / "at").read_text())
        return None

    def go_on_to(self, frame: int) -> None:
        """Have no other process begin with frames up to this one."""
        hand_over(self.folder / "at", str(frame).encode())

    def claimed(self, frame: int) -> AbstractContextManager[bool]:
        """Keep others from drawing a frame meanwhile; enters with whether none is at it."""
        return claimed(self._path(frame, ".lock"))

    def is_there(self, frame: int) -> bool:
        """Return whether a frame is ready."""
        return self._path(frame).exists()

    def put(self, frame: int, drawn: DrawnFrame) -> None:
        """Have a frame wait to be taken. Raises OSError."""
        hand_over(self._path(frame), pack(drawn))

    def take(self, frame: int) -> DrawnFrame:
        """Return a frame that waits, which is gone then. Raises OSError."""
        drawn: DrawnFrame = unpack(self._path(frame).read_bytes())
        self._path(frame).unlink()
        return drawn

    def _path(self, frame: int, end: str = "") -> Path:
        return self.folder / f"frame-{frame:06d}{end}"


def draw_ahead(
    folder: Path, frames: Sequence[int], reach: int, draw: Callable[[int], DrawnFrame]
) -> Iterator[int]:
    """Draw frames of an animation that no other process draws, and yield their numbers.

    They are up to `reach` frames past Blender's; it ends when Blender is at the last one.

    Raises:
        OSError: The folder is not writable.
    """
    shared, last = SharedFrames(folder), frames[-1]
    while (at := shared.at) is None or at < last:
        for frame in [frame for frame in frames if at is not None and frame > at][:reach]:
            with shared.claimed(frame) as is_mine:
                # Blender may have gone on, or somebody else have drawn it, since it was looked at.
                at = shared.at
                if is_mine and at is not None and at < frame and not shared.is_there(frame):
                    shared.put(frame, draw(frame))
                    yield frame
                    break
        else:
            time.sleep(LOOK)


@dataclass
class FramesAhead:
    """The processes that draw an animation's frames ahead."""

    shared: SharedFrames
    held: ExitStack
    """Resources of the folder."""
    threads: int
    """That the user lets work side by side."""
    jobs: list[Job] = field(default_factory=list)
    _last: tuple[int, DrawnFrame] | None = None

    @classmethod
    def begin(cls, scene: bpy.types.Scene, frames: Sequence[int], count: int) -> FramesAhead:
        """Have `count` processes draw frames of a scene ahead; UserError where they cannot be started."""
        held = ExitStack()
        made = cls(SharedFrames(held.enter_context(temporary_folder())), held, limits.chosen_threads())
        try:
            # Files are written on the main thread, which the render waits for.
            main_thread.call(lambda: write_blend(made.shared.blend))
            blend = made.shared.blend
            for _ in range(count):
                made.jobs.append(Job())
                start(
                    made.jobs[-1], blend.with_suffix(".json"), ["frames"], scene.name, one_thread=True,
                    blend=str(blend), into=str(made.shared.folder), reach=WAITING * count,
                    frames=[frames[0], frames[-1] + 1, scene.frame_step],
                )  # fmt: skip
            limits.limit_threads(1)
        except BaseException:
            made.end()
            raise
        return made

    def frame(self, frame: int) -> DrawnFrame | None:
        """Return a frame that another process has drawn or is drawing; None where it is to be drawn here.

        Passes checkpoints.
        """
        if self._last is not None and self._last[0] == frame:
            # Each view layer of a scene asks for it.
            return self._last[1]
        self.shared.go_on_to(frame)
        while True:
            checkpoint()
            for job in self.jobs:
                # A process waits while its pipe is full.
                job.poll()
            with self.shared.claimed(frame) as is_nobodys:
                if self.shared.is_there(frame):
                    self._last = frame, self.shared.take(frame)
                    return self._last[1]
                if is_nobodys:
                    return None
            time.sleep(LOOK)

    def end(self) -> None:
        """End the processes, without waiting for it, and remove what they have drawn."""
        limits.limit_threads(self.threads)
        end_meanwhile(self.jobs, self.held.close)


_ahead: FramesAhead | None = None
_is_tried = False
"""True if the present animation was prepared."""


def frame_ahead(scene: bpy.types.Scene, frame: int, pixels: int) -> DrawnFrame | None:
    """Return a frame of an animation, by the scene's number, that another process draws.

    None where it is to be drawn here. With the animation's first frame processes begin, if its pictures have
    enough `pixels` for that.
    """
    global _ahead, _is_tried
    try:
        if not _is_tried:
            _is_tried = True
            frames = range(frame, scene.frame_end + 1, scene.frame_step)
            # This process mostly waits, as others draw the next frames.
            count, render = jobs.fitting(pixels), scene.render
            count = min(count, render.threads) if render.threads_mode == "FIXED" else count
            if count > 1 and len(frames) >= jobs.LEAST_SHARE:
                _ahead = FramesAhead.begin(scene, frames, count)
        return None if _ahead is None else _ahead.frame(frame)
    except (OSError, UserError):
        # Such as a full disk: the frames can be drawn here as well.
        _end()
        return None


def _end() -> None:
    global _ahead
    if _ahead is not None:
        _ahead.end()
    _ahead = None


@at(*RENDERS)
def forget(*_: object) -> None:
    """End what draws ahead, and begin anew with the next animation."""
    global _is_tried
    _end()
    _is_tried = False
