"""Work in another process, so that the window stays alive."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from ...core.base.time_left import TimeLeft
from ...render.processes.clip_process import CLIP, ClipProcess
from ...render.viewport.viewport import PREVIEW
from .text import left_words

LOOK = 0.05
"""Seconds between two looks at the work."""
SOON = 0.005
"""The same for a look that waits."""


class Work[T]:
    """A function that is called in the preview's process, which does nothing else meanwhile."""

    def __init__(self, function: Callable[[], T], own: ClipProcess | None = None) -> None:
        """It begins once the work before has ended.

        Args:
            function: The function, one for `parcel.pack`.
            own: Another process, which leaves the preview running.

        Raises:
            UserError: The process cannot be started.
        """
        self._clock = TimeLeft(time.monotonic())
        self._pause = ExitStack()
        if own is None:
            # Both would take all processors, and the same memory.
            self._pause.enter_context(PREVIEW.paused())
        self._process = own or CLIP
        try:
            self._call = self._process.call(function)
        except BaseException:
            self._pause.close()
            raise

    @property
    def stage(self) -> str:
        """How far it is, in a few words."""
        left = left_words(self._clock.at(time.monotonic(), self._call.share))
        done = f"{100 * self._call.share:.0f}%" if self._call.share else self._call.stage
        return ", ".join(filter(None, (done, left[:1].lower() + left[1:])))

    @property
    def shown(self) -> list[Any]:
        """All that the function has shown so far (`calls.show`)."""
        return self._call.shown

    @property
    def error(self) -> Exception | None:
        """The function's error."""
        return self._call.error

    def ended(self, wait: float = 0.0) -> bool:
        """Return whether it has ended, after so many seconds at most."""
        until = time.monotonic() + wait
        while True:
            self._process.poll()
            if self._call.ended:
                self._pause.close()
            if self._call.ended or time.monotonic() >= until:
                return self._call.ended
            time.sleep(SOON)

    def result(self) -> T:
        """Return the function's result after its end, or raise its error."""
        return self._call.result()

    def cancel(self) -> None:
        """Do it no more: it ends at its next checkpoint."""
        self._call.cancel()
        self._pause.close()
