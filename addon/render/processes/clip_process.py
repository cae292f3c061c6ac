"""The process that computes with a clip for a window: pictures of the preview, picks and strokes.

It is a Blender in the background with another GPU context. It reads a shot once and keeps it, so that depth,
subjects and highlights are remembered as long as they are worked with.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from ...core.base.calls import Call, Caller
from ...core.base.job import Job
from ...scene.base.events import watch
from .launcher import CalledProcess, start
from .shots import SentShots

IDLE = 30.0
"""Seconds that a process waits for another call: the next picture comes at once meanwhile."""
LOOK = 1.0
"""Seconds between two looks whether it is idle."""


class ClipProcess(CalledProcess):
    """A process that is ended when nothing was called for long."""

    stays: Callable[[], bool] = staticmethod(lambda: False)
    """Returns whether another call may come at any time."""

    def __init__(self, yields: bool = False) -> None:
        """Let a window and other processes go first if it `yields`."""
        super().__init__("preview's process")
        self._yields = yields
        self._used = 0.0
        """When it was called last; infinite before the first call."""
        # Blender knows timers by the object.
        self._timer = self._look

    def begin(self) -> Caller:
        """Start the process if none runs.

        Raises:
            UserError: It cannot be started.
        """
        return self.started(self._start)

    def _start(self, job: Job, folder: Path) -> SentShots:
        start(job, folder / "job.json", ["clip"], yields=self._yields, folder=str(folder))
        self._used = float("inf")
        watch(self._timer, LOOK, stays=True)
        return SentShots(folder)

    def call[T](self, function: Callable[[], T]) -> Call[T]:
        """Have a function called there, and return at once; errors as of `begin`."""
        call = self.begin().call(function)
        self._used = time.monotonic()
        return call

    def _look(self) -> float | None:
        """A timer's turn: end a process that nothing was called of for long."""
        if self._caller is None:
            return None
        self.poll()
        if not self._caller.is_idle or self.stays():
            self._used = time.monotonic()
        elif time.monotonic() - self._used > IDLE or not self._caller.job.is_running:
            self.end()
            return None
        return LOOK


CLIP = ClipProcess()
"""The one of this Blender: it takes all processors, so there are not two."""
