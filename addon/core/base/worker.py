"""Child processes that do a piece of work, or answer calls of functions, and end with their parent.

Requests and reports are messages (`messages`), one a line, on the pipes of the process. Their values, such as
arguments and results, are parcels in a folder of the process; a message that names a file follows the file.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from typing import IO, Any

from .atomic import temporary_folder
from .errors import UserError
from .messages import PATIENCE, Cancel, Failure, Message, Parcel, Progress, Result, Warned, decode, write
from .parcel import Named, no_name, pack
from .progress import Cancelled
from .time_left import LEAST_SHARE, Advance, TimeLeft

REMEMBERED = 20
"""Last lines of standard error that are kept, to explain the end of a process."""
ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "VECLIB_MAXIMUM_THREADS": "1"}
"""Environment of our processes; the user's variables take precedence. Threads of OpenBLAS and Accelerate wait
for each other on small matrices. A solve of 87 frames at 368x480 on two idle cores takes 24.3 and 23.8
instead of 31.9 and 29.6 CPU s (two runs each), and 22.9 and 22.5 instead of 24.2 and 22.6 s of wall time."""
YIELDING = 10
"""Niceness in [0, 19] of a process that lets the interface stay responsive. Chosen by inspection."""
LOOK = 0.01
"""Seconds between two looks at a process that is waited for."""
READ = 1 << 16
"""Bytes that are read at once: as many as a pipe of Linux holds."""
LEAST_STEPS = 3
"""Equal steps that an estimate of the time left needs, where that is less than `LEAST_SHARE`."""


class _Lines:
    """The lines of a pipe, as far as they have come: reading does not wait."""

    def __init__(self, pipe: IO[bytes] | None) -> None:
        assert pipe is not None
        self._pipe, self._rest = pipe, b""
        # Also on Windows, since Python 3.12.
        os.set_blocking(pipe.fileno(), False)

    def read(self, is_last: bool) -> list[str]:
        """Return the new lines, with an unfinished one if it is the last."""
        while not self._pipe.closed:
            try:
                part = os.read(self._pipe.fileno(), READ)
            except BlockingIOError:
                break
            except OSError:
                # Windows' way to report a closed pipe.
                part = b""
            self._rest += part
            if not part:
                self._pipe.close()
        *lines, self._rest = self._rest.split(b"\n")
        if is_last and self._rest:
            lines, self._rest = [*lines, self._rest], b""
        return [line.decode("utf-8", "replace").rstrip("\r") for line in lines]


class Ended(UserError):  # noqa: N818
    """The process has ended before it answered."""


class Call[T]:
    """A function that another process calls."""

    def __init__(self, number: int, send: Callable[[Message], None]) -> None:
        self.number, self._send = number, send
        self.stage, self.share, self.advance = "", 0.0, Advance()
        """Name of the present stage, and the finished share in [0, 1], which never falls."""
        self.shown: list[Any] = []
        """All that the function has shown so far."""
        self.is_begun = self.ended = False
        self.error: Exception | None = None
        self._is_cancelled = False
        self._value: list[T] = []

    def result(self) -> T:
        """Return the function's result, or raise its error."""
        if self.error is not None:
            raise self.error
        return self._value[0]

    def cancel(self) -> None:
        """Call it no more: it ends at its next checkpoint."""
        if not (self.ended or self._is_cancelled):
            self._is_cancelled = True
            self._send(Cancel(self.number))

    def end(self, error: Exception | None, value: Sequence[T] = ()) -> None:
        """Set the result or the error."""
        self.error, self._value, self.ended = error, list(value), True


class Worker:
    """A child process that reports by `messages.speak`, as of the last `poll`.

    Its pipes are read by `poll` and `wait` alone, so that it may have to wait for these once they are full.
    """

    def __init__(self, program: str = "process") -> None:
        """Set the process's name in errors."""
        self.done, self.total = 0, 0
        """Steps of the present stage; 0 before the first report."""
        self.stage = ""
        self.share = 0.0
        """Finished share of the whole work in [0, 1]."""
        self.left: float | None = None
        """Estimated seconds left, or None."""
        self.warnings: list[str] = []
        self.failure: Failure | None = None
        """The reason why the work was not done."""
        self.is_running = self.is_cancelled = False
        self.process: subprocess.Popen[bytes] | None = None
        self.naming: Named = no_name
        """Names things in calls, as of `pack`."""
        self.calls: dict[int, Call[Any]] = {}
        """The calls that have not ended, in their order, by number."""
        self._count = 0
        self._program = program
        self._first, self._advance = 0.0, Advance()
        self._time_left: TimeLeft | None = None
        self._last: Message | None = None
        self._messages, self._complaints = deque[Message](), deque[str](maxlen=REMEMBERED)
        self._said: _Lines | None = None
        self._complained: _Lines | None = None
        self._has_ended = False
        self._held = ExitStack()
        self._then: Callable[[], object] | None = None
        self._until = 0.0
        """The process is killed then, once it was asked to end."""

    @cached_property
    def folder(self) -> Path:
        """A folder for files of the process, which is removed at its end."""
        return self._held.enter_context(temporary_folder())

    def start(
        self,
        command: Sequence[str],
        request: object = None,
        yielding: bool = False,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """Start the process.

        Args:
            command: Its words.
            request: The value of `messages.told` there.
            yielding: True for a lower priority.
            environment: Its variables.

        Raises:
            UserError: It cannot be started.
        """
        first = None if request is None else self._packed(request)
        try:
            process = self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0,
                env={**ONE_BLAS_THREAD, **environment, "PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for the parent, which ends the process.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0)
                | (getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0) if yielding else 0),
            )  # fmt: skip
        except OSError as error:
            self._held.close()
            raise UserError(f"the {self._program} cannot be started: {error.strerror}") from None
        if yielding and hasattr(os, "setpriority"):
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, process.pid, YIELDING)
        self._said, self._complained = _Lines(process.stdout), _Lines(process.stderr)
        self.is_running = True
        _started.append(self)
        if first is not None:
            self._send(first)

    def _packed(self, value: object) -> Parcel:
        file = self.folder / f"{self._count:06d}"
        try:
            file.write_bytes(pack(value, self.naming))
        except OSError as error:
            raise UserError(f"{file} cannot be written: {error.strerror}") from None
        self._count += 1
        return Parcel(self._count - 1, str(file))

    def _send(self, message: Message) -> None:
        """Send a message: the pipe holds it until it is read."""
        assert self.process is not None and self.process.stdin is not None
        write(self.process.stdin, message)

    def call[T](self, function: Callable[[], T]) -> Call[T]:
        """Have a function called after the calls before, and return at once; it must be one for `pack`.

        Raises:
            UserError: The arguments cannot be written.
        """
        parcel = self._packed(function)
        call = self.calls[parcel.call] = Call[T](parcel.call, self._send)
        self._send(parcel)
        return call

    def _read(self) -> None:
        """Take in the lines that have come, the last ones once the process has ended."""
        if self.process is None or self._said is None or self._complained is None or self._has_ended:
            return
        # All that an ended process wrote is in its pipes.
        self._has_ended = self.process.poll() is not None
        self._messages += filter(None, map(decode, self._said.read(self._has_ended)))
        self._complaints += (line.strip() for line in self._complained.read(self._has_ended))

    def poll(self) -> list[Message]:
        """Process the reports since the last call and return them; updates `is_running`."""
        heard = []
        if self.is_running:
            self._read()
        while self.is_running and self._messages:
            message = self._messages.popleft()
            heard.append(message)
            self._last = message
            if isinstance(message, Parcel):
                self._answered(message)
            elif isinstance(message, Progress) and message.call is not None:
                call = self.calls[message.call]
                call.stage, call.is_begun = message.stage, True
                call.share = call.advance.to(message.share or 0.0)
            elif isinstance(message, Progress):
                self._progressed(message)
            elif isinstance(message, Warned):
                self.warnings.append(message.text)
        if self.is_running and self._has_ended:
            self.is_running, self.failure = False, self._why()
            self._drop(Ended("its process ended" if self.failure is None else self.failure.text))
            self._close()
        return heard

    def _answered(self, answer: Parcel) -> None:
        """Take in a value that a call has shown, or its end."""
        if answer.is_last:
            self.calls.pop(answer.call).end(*answer.take())
        else:
            self.calls[answer.call].shown.append(answer.take())

    def _drop(self, error: Exception) -> None:
        """End all calls with an error."""
        while self.calls:
            self.calls.popitem()[1].end(error)

    def _progressed(self, message: Progress) -> None:
        if not message.done and message.share is None:
            # The wait for the first step does not measure the pace.
            self.stage = self.stage if self.done else message.stage
            return
        self.stage, self.done, self.total = message.stage, message.done, message.total
        steps = message.done / max(message.total, 1)
        self.share = steps if message.share is None else self._advance.to(message.share)
        now = time.monotonic()
        if self._time_left is None:
            # The first report does not measure the pace: an earlier run did that part, or the first frame
            # found depth for its neighbours, too.
            least = LEAST_SHARE if message.share is not None else LEAST_STEPS / max(message.total, 1)
            self._first, self._time_left = self.share, TimeLeft(now, min(LEAST_SHARE, least))
        self.left = self._time_left.at(now, (self.share - self._first) / max(1 - self._first, 1e-9))

    def wait(self, seconds: float) -> None:
        """Wait for the end of all reports, at most `seconds`."""
        until = time.monotonic() + seconds
        self._read()
        while not self._has_ended and self.is_running and time.monotonic() < until:
            time.sleep(LOOK)
            self._read()

    def leave(self, then: Callable[[], object] | None = None) -> None:
        """Ask the process to end, without waiting for it; harmless if it is not running.

        `then` is called after its end, in `tend` or as this process ends.
        """
        if self.is_running and self.process is not None:
            self.is_running, self.is_cancelled = False, True
            self._drop(Cancelled())
            self._then, self._until = then, time.monotonic() + PATIENCE
            self.process.terminate()

    def has_left(self) -> bool:
        """Return whether a process that was asked to end has ended; kill it if that takes too long."""
        if self.process is not None and self.process.poll() is None:
            if time.monotonic() > self._until:
                self.process.kill()
            return False
        self._close()
        return True

    def join(self, patience: float = PATIENCE) -> None:
        """Wait for the end of a process that was asked to end; kill it after `patience` seconds."""
        self._until = min(self._until, time.monotonic() + patience)
        while not self.has_left():
            time.sleep(LOOK)

    def _close(self) -> None:
        """Remove the folder of the process, which has ended, and take the next step."""
        if self in _started:
            _started.remove(self)
        self._held.close()
        then, self._then = self._then, None
        if then is not None:
            then()

    def _why(self) -> Failure | None:
        """Return the failure of a process that has ended, or None if its work is done."""
        assert self.process is not None
        status = self.process.wait()
        if isinstance(self._last, Result):
            return None
        if isinstance(self._last, Failure):
            return self._last
        if status < 0:
            return Failure(f"the {self._program} was ended by {signal.Signals(-status).name}")
        said = f" ({self._complaints[-1].removeprefix('error: ')})" if self._complaints else ""
        return Failure(f"the {self._program} ended with status {status}{said}")


_started: list[Worker] = []
"""Processes that have not ended, as far as was noticed."""


def end(workers: Sequence[Worker], patience: float = PATIENCE) -> None:
    """Terminate processes, and kill those that live after `patience` seconds."""
    for worker in workers:
        worker.leave()
    for worker in workers:
        worker.join(patience)


def tend() -> None:
    """Look at the processes that were asked to end."""
    for worker in [each for each in _started if each.is_cancelled]:
        worker.has_left()


def end_all(patience: float = PATIENCE) -> None:
    """Call `end` for all processes."""
    end([*_started], patience)


atexit.register(end_all)
