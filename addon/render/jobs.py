"""Several processes that render shares of the same frames side by side, on one machine."""

from __future__ import annotations

import itertools
import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..core.base import limits, memory
from ..core.base.child import Child, end
from ..core.base.counting import ranges
from ..core.base.errors import UserError
from ..core.base.messages import Message, Progress, Warned
from .launcher import start

TRIES = 2
"""How often a share is begun before its frames are given up."""

LEAST_SHARE = 8
"""Frames that are worth a process of its own: it takes 2 to 3 s to start, as two frames do."""
PROCESS, A_PIXEL = 900 * memory.MB, 1500
"""Bytes that a process takes at its peak, and for each pixel of a frame besides: one that finds depth and
draws it took 1.2 GB at 640x360 and 2.2 GB at 1280x720 (the largest resident set, of one thread)."""

Command = Callable[[Sequence[int], int], list[str]]
"""Arguments of the command line that render frames as the share of this number."""
Here = Callable[[Sequence[int], Callable[[int], None]], None]
"""Renders frames in this process, and tells of each one that is done."""


def fitting(pixels: int) -> int:
    """How many processes work well side by side, by processors, or the threads that the user allows, and free
    memory, on pictures of so many pixels; at least 1."""
    room = memory.free() // (PROCESS + A_PIXEL * pixels)
    return max(1, min(limits.threads(), room))


def shares(frames: Sequence[int], count: int) -> list[list[int]]:
    """At most `count` runs of neighbouring frames, as equal as can be: neighbours share their depth."""
    cuts = [len(frames) * n // count for n in range(count + 1)]
    return [list(frames[a:b]) for a, b in itertools.pairwise(cuts) if a < b]


@dataclass
class _Share:
    """Frames that one process renders."""

    number: int
    todo: list[int]
    """Those that it has not said to be done."""
    tries: int = 0
    child: Child | None = None


def render_side_by_side(
    frames: Sequence[int],
    count: int,
    command: Command,
    here: Here,
    done: Callable[[int], None],
    note: Callable[[str], None],
) -> None:
    """Render frames in `count` processes, of which this one is the first and the others are started; `done`
    is called with each frame, in whichever order, and `note` of what a process warns of.

    What a process has left when it fails, this one included, is begun once more in a new one. UserError
    naming the frames that are not done at the end. Whatever else is raised here, Ctrl-C included, ends all of
    them; where this process is killed they end by themselves.
    """
    events: queue.Queue[tuple[_Share, Message | None]] = queue.Queue()
    own, *others = (_Share(number, todo) for number, todo in enumerate(shares(frames, count)))
    left, failed = len(others), list[_Share]()

    def hear(share: _Share, message: Message | None) -> None:
        nonlocal left
        if isinstance(message, Progress) and message.frame in share.todo:
            share.todo.remove(message.frame)
            done(message.frame)
        elif isinstance(message, Warned):
            note(message.text)
        if message is not None:
            return
        assert share.child is not None
        if share.child.failure is None or not share.todo:
            left -= 1
        elif share.tries < TRIES:
            _start(share, command, events)
        else:
            failed.append(share)
            left -= 1

    def drawn(frame: int) -> None:
        own.todo.remove(frame)
        done(frame)
        while not events.empty():
            hear(*events.get())

    try:
        for share in others:
            _start(share, command, events)
        own.tries += 1
        try:
            here(list(own.todo), drawn)
            # Others come to their last frames last, and find those made: not what one is at or comes to next.
            while len((behind := max(others, key=lambda share: len(share.todo), default=own)).todo) > 2:
                own.todo = [behind.todo.pop()]
                here(list(own.todo), drawn)
        except UserError:
            _start(own, command, events)
            left += 1
        while left:
            hear(*events.get())
    finally:
        end([share.child for share in (own, *others) if share.child is not None])
    if failed:
        lost = sorted(frame for share in failed for frame in share.todo)
        whys = [share.child.failure for share in failed if share.child is not None]
        reasons = sorted({why.text for why in whys if why is not None})
        remedies = {remedy for why in whys if why is not None for remedy in why.remedies}
        raise UserError(
            f"frames {ranges(lost)} could not be finished: {'; '.join(reasons)}", *sorted(remedies)
        )


def _start(share: _Share, command: Command, events: queue.Queue[tuple[_Share, Message | None]]) -> None:
    share.tries += 1
    share.child = start(
        command(share.todo, share.number),
        lambda message: events.put((share, message)),
        environment=limits.ONE_THREAD,
    )
