"""How long work will still take, from how long it took so far."""

from __future__ import annotations

import time
from collections.abc import Callable

from .messages import Progress, send

LEAST_SHARE, LEAST_SECONDS = 0.1, 3.0
"""Of the work, and of time, before which nothing can be said."""
AGAIN = 0.01
"""Share by which work falls back when something is tried again."""
CONTRADICTS, SLACK = 2.0, 5.0
"""Times as long as the estimate before said, and seconds more, from which on two estimates contradict each
other: then nothing is known."""


class TimeLeft:
    """Estimates for work whose shares are about proportional to time, and of which parts may be tried again.

    While a part is tried again nothing is said, for nobody knows how many times it will be; what it took is
    not taken for the pace of the rest.
    """

    def __init__(self, now: float) -> None:
        """`now` and all times in seconds of any clock."""
        self._start = self._last = now
        self._highest = 0.0
        self._lost = 0.0
        self._said: tuple[float, float] | None = None

    def at(self, now: float, share: float) -> float | None:
        """Seconds left when a share in [0, 1] of the work is done; None where nothing can be said."""
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
