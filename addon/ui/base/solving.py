"""A solve that is under way."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from ...core.sfm.process import Opening, SolveProcess, SolveProgress
from ...core.sfm.steps import Sight


class Solving:
    """A solve from its first moment on.

    In a window the clip is opened and its frames counted, which takes seconds, in another process, so that
    the interface stays alive and ESC works.
    """

    running: ClassVar[Solving | None] = None
    """The last solve that was begun in this Blender; it may have ended."""

    def __init__(
        self, begin: Callable[[], SolveProcess], clip: str = "", opening: Opening | None = None
    ) -> None:
        """Begin a solve.

        Args:
            begin: Makes the process.
            clip: Name of the clip, to be shown.
            opening: The clip that is opened before.
        """
        self.clip = clip
        self.process: SolveProcess | None = None
        self.ended = False
        self.step = SolveProgress("Reading the clip", 0.0)
        """How far it is."""
        self._begin, self._opening = begin, opening

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
        if self.process is None:
            try:
                if self._opening is not None and not self._opening.poll():
                    return [self.step]
                self.process = self._begin()
            except BaseException:
                self.ended = True
                raise
        steps = self.process.poll()
        if steps:
            self.step = steps[-1]
        return steps

    def cancel(self) -> None:
        """End what is under way and leave the folder as it was; harmless after the end."""
        if self._opening is not None:
            self._opening.end()
        if self.process is not None:
            self.process.cancel()
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
