"""Frames of an animation that other processes draw ahead of Blender's render.

Blender renders an animation's frames one after the other in one process, in which a second processor hardly
helps. Other processes therefore open a copy of the file and draw later frames, each in one thread. The
engine takes finished frames, waits for a frame in progress, and draws the rest: the first frame, and all of
them if the others fail.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial

import bpy

from ...core.base import limits
from ...core.base.arrays import LinearRGBA
from ...core.base.atomic import temporary_folder
from ...core.base.errors import UserError
from ...core.base.progress import checkpoint
from ...core.base.worker import Call, Ended, Worker
from ...scene.base.events import RENDERS, at
from ...scene.gpu import main_thread
from . import jobs
from .launcher import start, write_blend

LOOK = 0.02
"""Seconds between two looks for a frame that another process draws."""
WAITING = 2
"""Frames for each process that may wait to be taken: those of 4K take 130 MB of disk each."""
GIVEN = 2
"""Frames that a process has to draw: the next one begins while this process draws one itself."""


@dataclass(frozen=True)
class DrawnFrame:
    """A frame as the engine draws it."""

    pictures: dict[str, LinearRGBA]
    """(H, W, 4) linear, premultiplied, of the pass Combined, and (H, W, 1) of others, by name; float32."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""


Draw = Callable[[str, int], DrawnFrame]
"""Draws a frame of a scene, by the scene's name and number, in another process."""


@dataclass
class FramesAhead:
    """The processes that draw an animation's frames ahead."""

    workers: list[Worker]
    scene: str
    """The scene's name."""
    frames: Sequence[int]
    """All frames of the animation."""
    draw: Draw
    held: ExitStack = field(default_factory=ExitStack)
    """The folder with the .blend that all processes draw from."""
    threads: int = field(default_factory=limits.chosen_threads)
    """That the user lets work side by side."""
    _calls: dict[int, Call[DrawnFrame]] = field(default_factory=dict)
    """By frame, those that are drawn elsewhere."""
    _last: tuple[int, DrawnFrame] | None = None

    @classmethod
    def begin(cls, scene: bpy.types.Scene, frames: Sequence[int], count: int, draw: Draw) -> FramesAhead:
        """Have `count` processes draw frames of a scene ahead; UserError where they cannot be started."""
        made = cls([], scene.name, frames, draw)
        try:
            blend = made.held.enter_context(temporary_folder()) / "scene.blend"
            # Files are written on the main thread, which the render waits for.
            main_thread.call(lambda: write_blend(blend))
            for _ in range(count):
                made.workers.append(Worker())
                start(made.workers[-1], ["frames"], scene.name, one_thread=True, blend=blend)
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
        while True:
            checkpoint()
            self._go_on_to(frame)
            call = self._calls.get(frame)
            if call is None or not (call.is_begun or call.ended):
                # A frame that was not begun is drawn here.
                self._go_on_to(frame + 1)
                return None
            if call.ended:
                del self._calls[frame]
                if call.error is not None:
                    return None
                self._last = frame, call.result()
                return self._last[1]
            time.sleep(LOOK)

    def _go_on_to(self, frame: int) -> None:
        """Cancel frames before this one, and give the next ones to the processes with the fewest."""
        for worker in self.workers:
            worker.poll()
        for number, call in [*self._calls.items()]:
            if number < frame or isinstance(call.error, Ended):
                call.cancel()
                del self._calls[number]
        following = (each for each in self.frames if each > frame)
        for _, number in zip(range(WAITING * len(self.workers)), following, strict=False):
            running = [worker for worker in self.workers if worker.is_running]
            least = min(running, key=lambda worker: len(worker.calls), default=None)
            if number not in self._calls and least is not None and len(least.calls) < GIVEN:
                self._calls[number] = least.call(partial(self.draw, self.scene, number))

    def end(self) -> None:
        """End the processes, without waiting for it, and remove what they have drawn."""
        limits.limit_threads(self.threads)
        for worker in self.workers:
            worker.leave()
        self.held.close()


_prepared: list[FramesAhead | None] = []
"""The processes of the present animation, or None without any; empty before its first frame."""


def frame_ahead(scene: bpy.types.Scene, frame: int, pixels: int, draw: Draw) -> DrawnFrame | None:
    """Return a frame of an animation, by the scene's number, that another process draws by `draw`.

    None where it is to be drawn here. With the animation's first frame processes begin, if its pictures have
    enough `pixels` for that.
    """
    try:
        if not _prepared:
            _prepared.append(None)
            frames = range(frame, scene.frame_end + 1, scene.frame_step)
            # This process mostly waits, as others draw the next frames.
            count, render = jobs.fitting(pixels), scene.render
            count = min(count, render.threads) if render.threads_mode == "FIXED" else count
            if count > 1 and len(frames) >= jobs.LEAST_SHARE:
                _prepared[0] = FramesAhead.begin(scene, frames, count, draw)
        return None if _prepared[0] is None else _prepared[0].frame(frame)
    except (OSError, UserError):
        # Such as a full disk: the frames can be drawn here as well.
        forget()
        _prepared.append(None)
        return None


@at(*RENDERS)
def forget(*_: object) -> None:
    """End the processes, and begin anew with the next animation."""
    for ahead in _prepared:
        if ahead is not None:
            ahead.end()
    _prepared.clear()
