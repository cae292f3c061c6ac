"""A solve that is under way."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from ..core.base.progress import Cancelled, reporting
from ..core.base.time_left import TimeLeft
from ..core.sfm.process import SolveProcess, SolveProgress
from ..core.sfm.watching import Sight


class Solving:
    """A solve from its first moment on: the clip is opened and its frames counted, which takes seconds, in
    a thread, so that the interface goes on meanwhile and ESC ends it."""

    def __init__(self, begin: Callable[[], SolveProcess], clip: str = "") -> None:
        """`begin` makes the process; it must not touch Blender's data. `clip` is its name, to be shown."""
        self.clip = clip
        self.process: SolveProcess | None = None
        self.ended = False
        self.step = SolveProgress("Reading the clip", 0.0)
        """How far it is."""
        self.left: float | None = None
        """Seconds that it will still take; None while nobody can say."""
        self._time_left = TimeLeft(time.monotonic())
        self._error: BaseException | None = None
        self._cancelled = threading.Event()
        self._opening = threading.Thread(target=self._open, args=(begin,), daemon=True)
        self._opening.start()

    def _open(self, begin: Callable[[], SolveProcess]) -> None:
        try:
            with reporting(self._on_progress):
                self.process = begin()
        except BaseException as error:  # raised again where the solve is waited for
            self._error = error

    def _on_progress(self, _stage: str, _share: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled

    @property
    def finished(self) -> bool:
        """Whether the folder holds the solve."""
        return self.process is not None and self.process.finished

    @property
    def sight(self) -> Sight | None:
        """What the tracker saw last; None before it has begun."""
        return self.process.sight if self.process is not None else None

    def poll(self) -> list[SolveProgress]:
        """As `SolveProcess.poll`; also raises what opening the clip raised."""
        if self._opening.is_alive():
            return [self.step]
        if self._error is not None:
            self.ended = True
            raise self._error
        assert self.process is not None
        steps = self.process.poll()
        for self.step in steps:
            self.left = self._time_left.at(time.monotonic(), self.step.share)
        return steps

    def cancel(self) -> None:
        """End what is under way and leave the folder as it was; harmless after the end."""
        self._cancelled.set()
        self._opening.join()
        if self.process is not None:
            self.process.cancel()
        self.ended = True
