"""Child processes that report progress and end with their parent."""

import atexit
import contextlib
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import IO

from .errors import UserError
from .messages import PATIENCE, Failure, Message, Progress, Result, Warned, decode
from .time_left import LEAST_SHARE, TimeLeft

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


class Job:
    """A process that reports by `messages.speak`, as of the last `poll`; it ends with its parent.

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
        self._program = program
        self._first = 0.0
        self._time_left: TimeLeft | None = None
        self._last: Message | None = None
        self._messages, self._complaints = deque[Message](), deque[str](maxlen=REMEMBERED)
        self._said: _Lines | None = None
        self._complained: _Lines | None = None
        self._has_ended = False

    def start(
        self, command: Sequence[str], yielding: bool = False, environment: Mapping[str, str] = os.environ
    ) -> None:
        """Start the process, with lower priority if `yielding`; raises UserError if it cannot start."""
        try:
            process = self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                env={**ONE_BLAS_THREAD, **environment, "PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for the parent, which ends the process.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0)
                | (getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0) if yielding else 0),
            )  # fmt: skip
        except OSError as error:
            raise UserError(f"the {self._program} cannot be started: {error.strerror}") from None
        if yielding and hasattr(os, "setpriority"):
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, process.pid, YIELDING)
        self._said, self._complained = _Lines(process.stdout), _Lines(process.stderr)
        self.is_running = True

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
            if isinstance(message, Progress):
                self._progressed(message)
            elif isinstance(message, Warned):
                self.warnings.append(message.text)
        if self.is_running and self._has_ended:
            self.is_running, self.failure = False, self._why()
        return heard

    def _progressed(self, message: Progress) -> None:
        if not message.done and message.share is None:
            # The wait for the first step does not measure the pace.
            self.stage = self.stage if self.done else message.stage
            return
        self.stage, self.done, self.total = message.stage, message.done, message.total
        self.share = message.done / max(message.total, 1) if message.share is None else message.share
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
        """End the process without waiting, as of `end_meanwhile`; harmless if it is not running."""
        if self.is_running:
            self.is_running, self.is_cancelled = False, True
            end_meanwhile([self], then)

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


def end(jobs: Sequence[Job], patience: float = PATIENCE) -> None:
    """Terminate processes, and kill those that live after `patience` seconds."""
    Leaving(jobs, None).join(patience)


class Leaving:
    """Processes that were asked to end."""

    def __init__(self, jobs: Sequence[Job], then: Callable[[], object] | None) -> None:
        self._processes = [job.process for job in jobs if job.process is not None]
        self._then = then
        self._until = time.monotonic() + PATIENCE
        for process in self._processes:
            if process.poll() is None:
                process.terminate()

    def look(self) -> bool:
        """Return whether all have ended; the next step follows then. Kill them if that takes too long."""
        alive = [process for process in self._processes if process.poll() is None]
        if alive and time.monotonic() > self._until:
            for process in alive:
                process.kill()
        if not alive and (then := self._then) is not None:
            self._then = None
            then()
        return not alive

    def join(self, patience: float = PATIENCE) -> None:
        """Wait for the end; kill the processes that live after `patience` seconds."""
        self._until = min(self._until, time.monotonic() + patience)
        while not self.look():
            time.sleep(LOOK)


_leaving: list[Leaving] = []


def end_meanwhile(jobs: Sequence[Job], then: Callable[[], object] | None) -> Leaving:
    """Ask processes to end, and call `then` after that, in `tend` or as this process ends."""
    leaving = Leaving(jobs, then)
    _leaving.append(leaving)
    return leaving


def tend() -> None:
    """Look at the processes that were asked to end."""
    _leaving[:] = [each for each in _leaving if not each.look()]


def end_all(patience: float = PATIENCE) -> None:
    """Wait for the processes that were asked to end; kill those that live after `patience` seconds."""
    while _leaving:
        _leaving.pop().join(patience)


atexit.register(end_all)
