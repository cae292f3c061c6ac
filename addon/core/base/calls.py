"""Calls of functions in another process, one after the other, which may be cancelled.

FOLDER/000012.call         a function and its arguments
FOLDER/000012.cancelled    nobody waits for it any longer
FOLDER/000012.1.shown      the first thing that it has shown meanwhile
FOLDER/000012.answer       its result or error

All of them appear whole. Progress comes as messages of the process (`messages`).
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from . import memory
from .atomic import hand_over
from .errors import UserError
from .job import Job, tend
from .messages import Progress, Warned, send
from .parcel import pack, unpack
from .progress import Cancelled, reporting
from .streams import say_to

LOOK = 0.004
"""Seconds between two looks for a call."""
APART = 0.05
"""Seconds between two messages about progress."""
Named = Callable[[Any], object]
"""Returns a name that stands for a thing, or None; or the thing of a name."""


class Ended(UserError):  # noqa: N818
    """The process has ended before it answered."""


class Call[T]:
    """A function that another process calls."""

    def __init__(self, folder: Path, number: int) -> None:
        self.number, self._path = number, folder / f"{number:06d}"
        self.stage, self.share = "", 0.0
        """Name of the present stage, and the finished share in [0, 1]."""
        self.shown: list[Any] = []
        """All that the function has shown so far."""
        self.ended = False
        self.error: Exception | None = None
        self._value: list[T] = []

    @property
    def file(self) -> Path:
        """The file of the call."""
        return self._path.with_suffix(".call")

    def result(self) -> T:
        """Return the function's result, or raise its error."""
        if self.error is not None:
            raise self.error
        return self._value[0]

    def cancel(self) -> None:
        """Call it no more: it ends at its next checkpoint."""
        if not self.ended:
            with suppress(OSError):
                self._path.with_suffix(".cancelled").touch()

    def look(self) -> None:
        """Read its answer, if there is one."""
        answer = self._path.with_suffix(".answer")
        is_last = answer.exists()
        while (shown := self._path.with_suffix(f".{len(self.shown) + 1}.shown")).exists():
            self.shown.append(unpack(shown.read_bytes()))
            shown.unlink()
        if is_last:
            self.error, self._value = unpack(answer.read_bytes())
            self.ended = True
            answer.unlink()


class Caller:
    """The calls of this process in another one, which may end at any time."""

    def __init__(self, job: Job, folder: Path, name: Named = lambda thing: None) -> None:
        """`job` runs `serve` in the folder; `name` as of `pack`."""
        self.job, self._folder, self._name = job, folder, name
        self._calls: list[Call[Any]] = []
        self._count = 0

    def call[T](self, function: Callable[[], T]) -> Call[T]:
        """Have a function called after the calls before, and return at once; it must be one for `pack`."""
        self._count += 1
        call = Call[T](self._folder, self._count)
        self._calls.append(call)
        hand_over(call.file, pack(function, self._name))
        return call

    @property
    def is_idle(self) -> bool:
        """Return whether all calls have ended."""
        return not self._calls

    def poll(self) -> None:
        """Read all answers since the last time; all calls end with `Ended` once the process has ended."""
        for message in self.job.poll():
            if isinstance(message, Progress):
                for call in self._calls:
                    if call.number == message.frame:
                        call.stage, call.share = message.stage, message.share or 0.0
            elif isinstance(message, Warned):
                say_to(2, f"note: {message.text}")
        for call in self._calls:
            call.look()
            if not (call.ended or self.job.is_running):
                why = self.job.failure
                call.error = Ended("its process ended" if why is None else why.text)
                call.ended = True
        self._calls = [call for call in self._calls if not call.ended]

    def drop(self) -> None:
        """End all calls as cancelled: the process is to be ended."""
        for call in self._calls:
            call.error, call.ended = Cancelled(), True
        self._calls.clear()


_show: Callable[[object], None] | None = None
"""Shows something to the process that waits for the present call."""


def show(value: object) -> None:
    """Show something to the process that has called the present function, if one has."""
    if _show is not None:
        _show(value)


def serve(folder: Path, thing: Named = lambda name: None) -> None:
    """Answer the calls in a folder until the process is ended; `thing` as of `unpack`."""
    number = 1
    while True:
        path = folder / f"{number:06d}.call"
        while not path.exists():
            tend()
            time.sleep(LOOK)
        _answer(path, number, thing)
        number += 1


def _answer(path: Path, number: int, thing: Named) -> None:
    """Call the function in a file, and write its result or error."""
    global _show
    cancelled, shown, reported = path.with_suffix(".cancelled"), 0, 0.0

    def on_progress(stage: str, share: float) -> None:
        nonlocal reported
        if cancelled.exists():
            raise Cancelled
        now = time.monotonic()
        if now - reported > APART:
            reported = now
            send(Progress(stage, 1, 1, number, share))

    def show_next(value: object) -> None:
        nonlocal shown
        shown += 1
        hand_over(path.with_suffix(f".{shown}.shown"), pack(value))

    try:
        _show = show_next
        function = unpack(path.read_bytes(), thing)
        path.unlink()
        with reporting(on_progress):
            on_progress("", 0.0)
            value = function()
        data = pack((None, [value]))
    except Exception as error:
        data = pack((_sendable(error), []))
    finally:
        _show = None
    cancelled.unlink(missing_ok=True)
    hand_over(path.with_suffix(".answer"), data)


def _sendable(error: Exception) -> Exception:
    """Return an error of ours for one that was raised."""
    if isinstance(error, (Cancelled, UserError)):
        return error
    if memory.is_shortage(error):
        return memory.shortage("it could not be finished")
    return Failed(f"{type(error).__name__}: {error}", traceback.format_exc())


class Failed(Exception):  # noqa: N818
    """A bug in a function that another process called: its class and text, and the traceback."""
