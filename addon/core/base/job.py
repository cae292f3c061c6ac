"""Child processes that report progress and end with their parent."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from . import priority
from .errors import UserError
from .messages import PATIENCE, Failure, Message, Progress, Result, Warned, decode
from .time_left import LEAST_SHARE, TimeLeft

REMEMBERED = 20
"""Last lines of standard error that are kept, to explain the end of a process."""

ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "VECLIB_MAXIMUM_THREADS": "1"}
"""Environment of our processes; the user's variables take precedence. Threads of OpenBLAS and Accelerate wait
for each other on small matrices. A solve of 87 frames at 368x480 on two idle cores takes 24.3 and 23.8
instead of 31.9 and 29.6 CPU s (two runs each), and 22.9 and 22.5 instead of 24.2 and 22.6 s of wall time."""

LEAST_STEPS = 3
"""Equal steps that an estimate of the time left needs, where that is less than `LEAST_SHARE`."""


class Job:
    """A process that reports by `messages.speak`, as of the last `poll`; it ends with its parent."""

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
        self.process: subprocess.Popen[str] | None = None
        self._program = program
        self._first = 0.0
        self._time_left: TimeLeft | None = None
        self._last: Message | None = None
        self._messages: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._complaints = deque[str](maxlen=REMEMBERED)
        self._listening: threading.Thread | None = None

    def start(
        self, command: Sequence[str], yielding: bool = False, environment: Mapping[str, str] = os.environ
    ) -> None:
        """Start the process, with lower priority if `yielding`; raises UserError if it cannot start."""
        try:
            process = self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                encoding="utf-8", errors="replace",
                env={**ONE_BLAS_THREAD, **environment, "PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for the parent, which ends the process.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0)
                | (priority.CREATION_FLAGS if yielding else 0),
            )  # fmt: skip
        except OSError as error:
            raise UserError(f"the {self._program} cannot be started: {error.strerror}") from None
        if yielding:
            priority.let_others_go_first(process)
        complaining = threading.Thread(target=self._complain, args=(process,), daemon=True)
        complaining.start()
        self._listening = threading.Thread(target=self._listen, args=(process, complaining), daemon=True)
        self._listening.start()
        self.is_running = True

    def _listen(self, process: subprocess.Popen[str], complaining: threading.Thread) -> None:
        assert process.stdout is not None
        # Windows cannot wait for a pipe with a timeout; a thread that reads lines can.
        with process.stdout as lines:
            for line in lines:
                if (message := decode(line)) is not None:
                    self._messages.put(message)
        complaining.join()
        self._messages.put(None)

    def _complain(self, process: subprocess.Popen[str]) -> None:
        assert process.stderr is not None
        with process.stderr as lines:
            for line in lines:
                self._complaints.append(line.strip())

    def poll(self) -> list[Message]:
        """Process the reports since the last call and return them; updates `is_running`."""
        heard = []
        while self.is_running:
            try:
                message = self._messages.get_nowait()
            except queue.Empty:
                break
            if message is None:
                self.is_running, self.failure = False, self._why()
                break
            heard.append(message)
            self._last = message
            if isinstance(message, Progress):
                self._progressed(message)
            elif isinstance(message, Warned):
                self.warnings.append(message.text)
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
        if self._listening is not None:
            self._listening.join(seconds)

    def leave(self, then: Callable[[], object] | None = None) -> None:
        """End the process in the background, then call `then` in a thread; harmless if it is not running."""
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
            return Failure(f"the {self._program} was ended by {signal.Signals(-status).name}", 128 - status)
        said = f" ({self._complaints[-1].removeprefix('error: ')})" if self._complaints else ""
        return Failure(f"the {self._program} ended with status {status}{said}", status)


def end(jobs: Sequence[Job], patience: float = PATIENCE) -> None:
    """Terminate processes, and kill those that live after `patience` seconds."""
    alive = [job.process for job in jobs if job.process is not None and job.process.poll() is None]
    for process in alive:
        process.terminate()
    for process in alive:
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def end_meanwhile(jobs: Sequence[Job], then: Callable[[], object] | None) -> threading.Thread:
    """Run `end` in a thread, which is returned, then call `then` there; Blender's exit waits for `then`."""

    def leave() -> None:
        end(jobs)
        if then is not None:
            then()

    leaving = threading.Thread(target=leave, daemon=then is None)
    leaving.start()
    return leaving
