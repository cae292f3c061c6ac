"""How long work will still take, from how long it took so far."""

from __future__ import annotations

import time
from collections.abc import Callable

from .messages import Progress, send

LEAST_SHARE, LEAST_SECONDS = 0.1, 3.0
"""Share of the work, and seconds, before which there is no estimate."""
AGAIN = 0.01
"""Share by which work falls back when something is tried again."""
CONTRADICTS, SLACK = 2.0, 5.0
"""Ratio to the previous estimate, and seconds more, from which two estimates contradict each other: then
there is none."""


class TimeLeft:
    """Estimates for work whose shares are about proportional to time, and whose parts may be repeated.

    While a part is repeated there is no estimate, as the number of repeats is unknown; its time does not
    count for the pace of the rest.
    """

    def __init__(self, now: float) -> None:
        """`now` and all times in seconds of any clock."""
        self._start = self._last = now
        self._highest = 0.0
        self._lost = 0.0
        self._said: tuple[float, float] | None = None

    def at(self, now: float, share: float) -> float | None:
        """Return the seconds left with a share in [0, 1] of the work done; None without an estimate."""
        is_again = share < self._highest - AGAIN
        if is_again:
            self._lost += now - self._last
        self._last = now
        if is_again:
            self._said = None
            return None
        self._highest = max(self._highest, share)
        worked = now - self._start - self._lost
        if share < LEAST_SHARE or worked < LEAST_SECONDS:
            return None
        left = worked * (1 - share) / share
        before, self._said = self._said, (now, left)
        if before is not None and left > CONTRADICTS * (before[0] + before[1] - now) + SLACK:
            return None
        return left


class Clock:
    """Progress of steps that are alike, sent to the parent and reported in lines with the time left.

    The first frame finds depth for its neighbours, too: it costs several times as much as each of the others,
    and is no measure of them.
    """

    def __init__(
        self, stage: str, total: int, report: Callable[[str], object], names: str = "frame {}"
    ) -> None:
        """`names` makes the name of a step from its frame's number."""
        self._stage, self._total, self._report, self._names = stage, total, report, names
        self._start = self._first = time.monotonic()
        self._done = 0

    def tick(self, frame: int | None, name: str = "") -> None:
        """A step is done: a frame, or what has another name."""
        self._done += 1
        send(Progress(self._stage, self._done, self._total, frame))
        now = time.monotonic()
        line = f"{name or self._names.format(frame)}: {self._done} of {self._total}"
        if self._done == 1:
            self._first = now
            self._report(f"{line}, {now - self._start:.1f} s")
            return
        each = (now - self._first) / (self._done - 1)
        left = round(each * (self._total - self._done))
        self._report(f"{line}, {each:.1f} s each, {left // 60} min {left % 60:02d} s left")
