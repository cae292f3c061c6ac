"""Commands of the shipping command line in processes of their own, with what they cost."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .. import store

HEADLESS = store.ROOT / "addon" / "headless.py"
PREFIX: tuple[str, ...] = ()
"""Words before each command, such as `nice`."""
LOOK = 0.05
"""Seconds between two looks at a process."""
PATIENCE = 3600.0
"""Seconds after which a command is ended."""
ONE_THREAD = {"VIRTUAL_APERTURE_THREADS": "1", "PYTHONUNBUFFERED": "1"}
"""Clips are rendered side by side, each in one thread."""
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


@dataclass(frozen=True)
class Ended:
    """A command that has ended."""

    status: int
    said: str
    """What it wrote on standard output."""
    message: str
    """Last line that it wrote on standard error; empty where it succeeded."""
    cpu_s: float
    """Processor seconds of the process and of its own."""
    first_cpu_s: float | None
    """The same until the file that was waited for was there; None where it never was."""
    wall_s: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def run(words: Sequence[object], log: Path, first: Path | None = None) -> Ended:
    """Run a command in a process of its own.

    Args:
        words: The command after Python's own name.
        log: File that its output is written to, beside `log` with the ending `.err` for its errors.
        first: File whose appearance divides the processor time.

    Returns:
        How it ended. A command that takes longer than `PATIENCE` is ended, and its message says so.
    """
    command = [*PREFIX, *map(str, (sys.executable, *words))]
    log.parent.mkdir(parents=True, exist_ok=True)
    began, first_cpu, late = time.monotonic(), None, False
    with log.open("wb") as out, log.with_suffix(".err").open("wb") as err:
        process = subprocess.Popen(command, stdout=out, stderr=err, env=os.environ | ONE_THREAD)
        try:
            while True:
                pid, state, used = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                if first is not None and first_cpu is None and first.exists():
                    first_cpu = tree_cpu(process.pid)
                if time.monotonic() - began > PATIENCE and not late:
                    late = True
                    process.terminate()
                time.sleep(LOOK)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            raise
        process.returncode = os.waitstatus_to_exitcode(state)
    said, complaint = (file.read_text(errors="replace").strip() for file in (log, log.with_suffix(".err")))
    message = complaint.splitlines()[-1].removeprefix("error: ") if complaint and process.returncode else ""
    if process.returncode and not message:
        message = f"ended with status {process.returncode} and no message"
    if late:
        message = f"not finished after {PATIENCE / 60:g} minutes"
    if first is not None and first_cpu is None and first.exists():
        first_cpu = used.ru_utime + used.ru_stime
    return Ended(
        process.returncode, said, message, used.ru_utime + used.ru_stime, first_cpu, time.monotonic() - began
    )


def tree_cpu(pid: int) -> float:
    """Processor seconds so far of a process, of those that it started, and of those that have ended; 0 for
    one that is gone, or where the system has no `/proc`."""
    total = 0.0
    # A process may end between two looks.
    with contextlib.suppress(OSError, ValueError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        total = sum(map(int, fields[11:15])) / TICKS
        for task in Path(f"/proc/{pid}/task").iterdir():
            total += sum(tree_cpu(int(child)) for child in (task / "children").read_text().split())
    return total
