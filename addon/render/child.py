"""Another process of this command line: heard line by line, and gone when the one that started it is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy

from ..core.base import priority
from ..core.base.errors import UserError

HEADLESS = Path(__file__).resolve().parents[1] / "headless.py"
PATIENCE = 10.0
"""Seconds in which a process that was told to end must have ended; then it is killed."""
REMEMBERED = 20
"""Last lines of standard error in which the reason of a failure is looked for."""


def launcher() -> list[str]:
    """The words before the arguments with which another process of this command line is started."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python", str(HEADLESS), "--",
        ]  # fmt: skip
    return [sys.executable, str(HEADLESS)]


class Child:
    """A process of this command line. Where its parent is killed it ends by itself."""

    def __init__(
        self, arguments: Sequence[str], hear: Callable[[str | None], None], yielding: bool = False
    ) -> None:
        """`hear` gets each line of standard output, and None after the last, on a thread of its own. With
        `yielding` other programs go first. UserError where the process cannot be started."""
        try:
            self.process = subprocess.Popen(
                [*launcher(), *arguments, "--end-with-input"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                encoding="utf-8", errors="replace", env=os.environ | {"PYTHONUNBUFFERED": "1"},
                # Ctrl-C is for whoever started it, who ends it.
                start_new_session=True, creationflags=priority.CREATION_FLAGS if yielding else 0,
            )  # fmt: skip
        except OSError as error:
            raise UserError(f"no other process can be started: {error.strerror}") from None
        if yielding:
            priority.let_others_go_first(self.process)
        self._complaints = deque[str](maxlen=REMEMBERED)
        complaining = threading.Thread(target=self._complain, daemon=True)
        complaining.start()
        threading.Thread(target=self._listen, args=(hear, complaining), daemon=True).start()

    def _listen(self, hear: Callable[[str | None], None], complaining: threading.Thread) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            hear(line)
        complaining.join()
        hear(None)

    def _complain(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._complaints.append(line.strip())

    @property
    def reason(self) -> str:
        """Why it failed, once it has ended: its error, or what ended it."""
        status, said = self.process.wait(), list(self._complaints)
        if errors := [line for line in said if line.startswith("error: ")]:
            return errors[-1].removeprefix("error: ")
        if status < 0:
            return f"the process was ended by {signal.Signals(-status).name}"
        return f"the process ended with status {status}" + (f" ({said[-1]})" if said else "")


def end(children: Sequence[Child]) -> None:
    """End processes, at first politely; harmless for those that have ended."""
    alive = [child.process for child in children if child.process.poll() is None]
    for process in alive:
        process.terminate()
    for process in alive:
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def end_with_input() -> None:
    """From now on end this process, as SIGTERM does, when its standard input closes: its parent is gone."""

    def watch() -> None:
        while os.read(0, 1):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()
