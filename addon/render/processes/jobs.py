"""Several processes that render shares of the same frames side by side, on one machine."""

import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ...core.base import limits, memory
from ...core.base.counting import ranges
from ...core.base.errors import UserError
from ...core.base.messages import Progress, Warned
from ...core.base.worker import Worker, end

TRIES = 2
"""How often a share is begun before its frames are given up."""
LOOK = 0.02
"""Seconds between two looks at the other processes."""
LEAST_SHARE = 8
"""Least frames for another process: starting it takes 2 to 3 s, as long as two frames."""
PROCESS, A_PIXEL = 900 * memory.MB, 1500
"""Bytes that a process takes at its peak, and for each pixel of a frame besides: one that finds depth and
draws it took 1.2 GB at 640x360 and 2.2 GB at 1280x720 (the largest resident set, of one thread)."""
Start = Callable[[Worker, Sequence[int], int], None]
"""Starts another process, which renders frames as the share of this number."""
Here = Callable[[Sequence[int], Callable[[int], None]], None]
"""Renders frames in this process, and reports each one."""


def fitting(pixels: int) -> int:
    """Return how many processes fit, 1 or more, by threads and by memory, for pictures of so many pixels."""
    return max(1, min(limits.threads(), memory.free() // (PROCESS + A_PIXEL * pixels)))


def shares(frames: Sequence[int], count: int) -> list[list[int]]:
    """At most `count` runs of neighbouring frames, as equal as can be: neighbours share their depth."""
    cuts = [len(frames) * n // count for n in range(count + 1)]
    return [list(frames[a:b]) for a, b in itertools.pairwise(cuts) if a < b]


@dataclass
class _Share:
    """Frames that one process renders."""

    number: int
    todo: list[int]
    """Frames that are not reported as done."""
    tries: int = 0
    worker: Worker = field(default_factory=Worker)

    def begin(self, start: Start) -> None:
        self.tries += 1
        self.worker = Worker()
        start(self.worker, self.todo, self.number)

    @property
    def has_failed(self) -> bool:
        return bool(self.todo) and self.worker.failure is not None


def render_side_by_side(
    frames: Sequence[int],
    count: int,
    start: Start,
    here: Here,
    done: Callable[[int], None],
    note: Callable[[str], None],
) -> None:
    """Render frames in several processes, of which this one is the first.

    The remaining frames of a failed process, this one included, are begun once more in a new one. Any error
    here other than of a frame, Ctrl-C included, ends all processes; if this process is killed they end, too.

    Args:
        frames: Numbers of frames.
        count: Number of processes.
        start: Starts another process.
        here: Renders frames in this one.
        done: Called with each frame, in any order.
        note: Called with each warning.

    Raises:
        UserError: Frames, which are named, are not done at the end.
    """
    every = own, *others = [_Share(number, todo) for number, todo in enumerate(shares(frames, count))]

    def listen() -> None:
        for share in [share for share in every if share.worker.is_running]:
            for message in share.worker.poll():
                if isinstance(message, Progress) and message.frame in share.todo:
                    share.todo.remove(message.frame)
                    done(message.frame)
                elif isinstance(message, Warned):
                    note(message.text)
            if not share.worker.is_running and share.has_failed and share.tries < TRIES:
                share.begin(start)

    def drawn(frame: int) -> None:
        own.todo.remove(frame)
        done(frame)
        listen()

    try:
        for share in others:
            share.begin(start)
        own.tries += 1
        try:
            here(list(own.todo), drawn)
            # Others come to their last frames last, and find those made: not what one is at or comes to next.
            while len((behind := max(others, key=lambda share: len(share.todo), default=own)).todo) > 2:
                own.todo = [behind.todo.pop()]
                here(list(own.todo), drawn)
        except UserError:
            own.begin(start)
        while any(share.worker.is_running for share in every):
            listen()
            time.sleep(LOOK)
    finally:
        end([share.worker for share in every])
    failed = [share for share in every if share.has_failed]
    if failed:
        lost = sorted(frame for share in failed for frame in share.todo)
        whys = [share.worker.failure for share in failed if share.worker.failure is not None]
        remedies = {remedy for why in whys for remedy in why.remedies}
        raise UserError(
            f"frames {ranges(lost)} could not be finished: {'; '.join(sorted({why.text for why in whys}))}",
            *sorted(remedies),
        )
