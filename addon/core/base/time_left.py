"""Estimates of the time left, from the elapsed time."""

import time
from collections.abc import Callable

from .messages import Progress, send

LEAST_SHARE, LEAST_SECONDS = 0.1, 3.0
"""Share of the work, by default, and seconds that an estimate needs."""
AGAIN = 0.01
"""Drop of the share that indicates a retry."""
CONTRADICTS, SLACK = 2.0, 5.0
"""Factor to the estimate before, and seconds more, beyond which an estimate contradicts it; none is given
then."""


class Advance:
    """The finished share of work whose parts may be retried: a retry goes on from the share before it."""

    def __init__(self) -> None:
        self._shown = self._before = self._retried = self._last = 0.0

    def to(self, share: float) -> float:
        """Return the share to show, which never falls, for a reported share in [0, 1]."""
        if share < self._last - AGAIN:
            self._before, self._retried = self._shown, share
        self._last = share
        done = (share - self._retried) / max(1 - self._retried, 1e-9)
        self._shown = max(self._shown, self._before + (1 - self._before) * done)
        return self._shown


class TimeLeft:
    """Estimates for work whose shares are proportional to time; times are in seconds of any clock."""

    def __init__(self, now: float, least_share: float = LEAST_SHARE) -> None:
        self._least_share = least_share
        self._start = now
        self._said: tuple[float, float] | None = None

    def at(self, now: float, share: float) -> float | None:
        """Return the seconds left when a share in [0, 1] is finished, or None if unknown."""
        worked = now - self._start
        if share < self._least_share or worked < LEAST_SECONDS:
            return None
        left = worked * (1 - share) / share
        before, self._said = self._said, (now, left)
        if before is not None and left > CONTRADICTS * (before[0] + before[1] - now) + SLACK:
            return None
        return left


class Clock:
    """Counts equal steps, sends them to the parent and reports the time left in lines.

    The first frame is no measure: it finds depth for its neighbours, too, and takes several times as long.
    """

    def __init__(
        self, stage: str, total: int, report: Callable[[str], object], names: str = "frame {}"
    ) -> None:
        """Format the name of a step from its frame's number by `names`."""
        self._stage, self._total, self._report, self._names = stage, total, report, names
        self._start = self._first = time.monotonic()
        self._done = 0

    def tick(self, frame: int | None, name: str = "") -> None:
        """Count a step, which is a frame or has another name."""
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
