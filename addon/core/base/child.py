"""A process of ours: its messages are heard as they come, and it is gone when the one that started it is."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from . import priority
from .errors import UserError
from .messages import PATIENCE, Failure, Message, Result, decode

REMEMBERED = 20
"""Last lines of standard error, in which a process that died says why."""

ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "VECLIB_MAXIMUM_THREADS": "1"}
"""Environment of our processes; the user's own variables take precedence, and Blender's own process keeps
its environment. Our matrices are small, and threads of OpenBLAS or Accelerate wait for each other: on an idle
machine with two cores, a solve of 87 frames at 368x480 takes 24.3 and 23.8 instead of 31.9 and 29.6 CPU s
(two runs each), and 22.9 and 22.5 instead of 24.2 and 22.6 s of wall time."""

Hear = Callable[[Message | None], object]


class Child:
    """A process that speaks as `messages.speak` has it; where its parent is killed it ends by itself."""

    def __init__(
        self,
        command: Sequence[str],
        hear: Hear,
        yielding: bool = False,
        environment: Mapping[str, str] = os.environ,
        name: str = "process",
    ) -> None:
        """`hear` gets each message, and None after the last, on a thread of its own. With `yielding` other
        programs go first. Errors call it `name`. UserError where it cannot be started."""
        self._name = name
        try:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                encoding="utf-8", errors="replace",
                env={**ONE_BLAS_THREAD, **environment, "PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for whoever started it, who ends it.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0)
                | (priority.CREATION_FLAGS if yielding else 0),
            )  # fmt: skip
        except OSError as error:
            raise UserError(f"the {name} cannot be started: {error.strerror}") from None
        if yielding:
            priority.let_others_go_first(self.process)
        self._last: Message | None = None
        self._complaints = deque[str](maxlen=REMEMBERED)
        complaining = threading.Thread(target=self._complain, daemon=True)
        complaining.start()
        self._listening = threading.Thread(target=self._listen, args=(hear, complaining), daemon=True)
        self._listening.start()

    def _listen(self, hear: Hear, complaining: threading.Thread) -> None:
        assert self.process.stdout is not None
        # Windows cannot wait on a pipe with a timeout; a thread that only reads lines can.
        with self.process.stdout as lines:
            for line in lines:
                if (message := decode(line)) is not None:
                    self._last = message
                    hear(message)
        complaining.join()
        hear(None)

    def _complain(self) -> None:
        assert self.process.stderr is not None
        with self.process.stderr as lines:
            for line in lines:
                self._complaints.append(line.strip())

    def wait(self, seconds: float) -> None:
        """Return when all was heard, or after so many seconds."""
        self._listening.join(seconds)

    @property
    def failure(self) -> Failure | None:
        """Why its work is not done, once it has ended: what it said, or what ended it; None where it is."""
        status = self.process.wait()
        if isinstance(self._last, Result):
            return None
        if isinstance(self._last, Failure):
            return self._last
        if status < 0:
            return Failure(f"the {self._name} was ended by {signal.Signals(-status).name}", 128 - status)
        said = f" ({self._complaints[-1].removeprefix('error: ')})" if self._complaints else ""
        return Failure(f"the {self._name} ended with status {status}{said}", status)


def end(children: Sequence[Child], patience: float = PATIENCE) -> None:
    """End processes, at first politely, for so many seconds; harmless for those that have ended."""
    alive = [child.process for child in children if child.process.poll() is None]
    for process in alive:
        process.terminate()
    for process in alive:
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
