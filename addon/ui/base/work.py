"""Work in a thread, so that the window stays alive."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

from ...core.base.progress import Cancelled, reporting
from ...core.base.time_left import TimeLeft
from ...render.viewport.viewport import PREVIEW
from .text import left_words

LOOK = 0.05
"""Seconds between two looks at the work."""


class Work[T]:
    """A function that is called in a thread, while nothing else works with the clip."""

    def __init__(
        self, function: Callable[[], T], after: Work[Any] | None = None, pauses_preview: bool = True
    ) -> None:
        """It begins once the work `after` has ended.

        Only what shares nothing with the preview may leave that running.
        """
        self._pauses_preview = pauses_preview
        self._clock = TimeLeft(time.monotonic())
        self.stage = ""
        self.error: BaseException | None = None
        self._value: list[T] = []
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(function, after), daemon=True)
        self._thread.start()

    def ended(self, wait: float | None = 0.0) -> bool:
        """Return whether it has ended, after so many seconds at most; None for any number."""
        self._thread.join(wait)
        return not self._thread.is_alive()

    def result(self) -> T:
        """Return the function's result after its end, or raise its error."""
        if self.error is not None:
            raise self.error
        return self._value[0]

    def cancel(self) -> None:
        """Do it no more: it ends at its next checkpoint."""
        self._cancelled.set()

    def _run(self, function: Callable[[], T], after: Work[Any] | None) -> None:
        try:
            if after is not None:
                after._thread.join()
            # Both would take all processors, and the same memory.
            paused = PREVIEW.paused() if self._pauses_preview else nullcontext()
            with paused, reporting(self._on_progress):
                self._on_progress("", 0.0)
                self._value.append(function())
        except BaseException as error:  # The error is reported by the waiting operator.
            self.error = error

    def _on_progress(self, stage: str, share: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled
        left = left_words(self._clock.at(time.monotonic(), share))
        words = (f"{100 * share:.0f}%" if share else stage, left[:1].lower() + left[1:])
        self.stage = ", ".join(filter(None, words))
