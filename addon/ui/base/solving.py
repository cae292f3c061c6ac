"""A solve that is under way."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from ...core.sfm.process import SolveProcess, SolveProgress
from ...core.sfm.tracking.tracker_pictures import Sight
from .work import Work


class Solving:
    """A solve from its first moment on.

    The clip is opened and its frames counted, which takes seconds, in a thread, so that the interface stays
    alive and ESC works.
    """

    running: ClassVar[Solving | None] = None
    """The last solve that was begun in this Blender; it may have ended."""

    def __init__(self, begin: Callable[[], SolveProcess], clip: str = "") -> None:
        """`begin` makes the process; it must not touch Blender's data. `clip` is its name, to be shown."""
        self.clip = clip
        self.process: SolveProcess | None = None
        self.ended = False
        self.step = SolveProgress("Reading the clip", 0.0)
        """How far it is."""
        self._opening = Work(begin, pauses_preview=False)

    @property
    def finished(self) -> bool:
        """Return whether the folder holds the solve."""
        return self.process is not None and self.process.finished

    @property
    def sight(self) -> Sight | None:
        """The last picture of the tracker; None before it has begun."""
        return self.process.sight if self.process is not None else None

    def poll(self) -> list[SolveProgress]:
        """Return `SolveProcess.poll`; also raises errors of opening the clip."""
        if not self._opening.ended():
            return [self.step]
        if self.process is None:
            self.ended = self._opening.error is not None
            self.process = self._opening.result()
        steps = self.process.poll()
        if steps:
            self.step = steps[-1]
        return steps

    def cancel(self) -> None:
        """End what is under way and leave the folder as it was; harmless after the end."""
        self._opening.cancel()
        self._opening.ended(None)
        if self._opening.error is None:
            self._opening.result().cancel()
        self.ended = True


def running_solve() -> Solving | None:
    """Return the solve that is under way in this Blender."""
    running = Solving.running
    return None if running is None or running.ended else running


def end_solve() -> None:
    """End the solve that is under way, if there is one; the folder stays as it was."""
    if (running := running_solve()) is not None:
        running.cancel()
    Solving.running = None
