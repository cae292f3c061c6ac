"""Ctrl-C ends a run of tests: every process that it started, and theirs.

Test processes, Blender and commands under test each answer Ctrl-C in their own way, or not at all, and those
in a session of their own never hear it. So the process that was called ends them all, by a mark that they
inherit in their environment. Where there is no /proc, only those end that hear Ctrl-C.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

MARK = "VIRTUAL_APERTURE_TEST_RUN"
"""Variable with the names of the runs that a process belongs to, the outermost first."""
GRACE = 1.0
"""Seconds in which processes may clean up."""


def pytest_configure(config: pytest.Config) -> None:
    """Mark what this run will start. SIGTERM, as schedulers send it, counts as Ctrl-C."""
    if not hasattr(config, "workerinput"):
        os.environ[MARK] = f"{os.environ.get(MARK, '')} {uuid.uuid4()}".strip()
        signal.signal(signal.SIGTERM, signal.default_int_handler)


def pytest_keyboard_interrupt(excinfo: pytest.ExceptionInfo[BaseException]) -> None:
    """End everything that this run has started; `--maxfail` and `pytest.exit` come here, too, and do not."""
    if excinfo.type is KeyboardInterrupt:
        patience = time.monotonic() + GRACE
        while running := list(_started(os.environ[MARK])):
            for process in running:
                _end(process, signal.SIGTERM if time.monotonic() < patience else signal.SIGKILL)
            time.sleep(0.05)


def _started(run: str) -> Iterator[int]:
    """Processes that are marked with a run and have not ended."""
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"{MARK}={run}".encode() in path.read_bytes():
                yield int(path.parent.name)
        except OSError:  # it has ended, or is not ours
            continue


def _end(process: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, number)
