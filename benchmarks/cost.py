"""What a piece of work costs: processor seconds, wall seconds, memory."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

STATUS = Path("/proc/self/status")
RESET = Path("/proc/self/clear_refs")


@dataclass(frozen=True)
class Cost:
    cpu_s: float
    """Of all threads and of child processes that have ended."""
    wall_s: float
    peak_mb: float
    """Memory at its peak over what the process held before; NaN where the system does not tell."""


def measured[T](work: Callable[[], T]) -> tuple[T, Cost]:
    """What the work returns, and what it cost."""
    held = _reset_peak()
    cpu, wall = cpu_seconds(), time.perf_counter()
    result = work()
    cost = Cost(cpu_seconds() - cpu, time.perf_counter() - wall, _status_mb("VmHWM") - held)
    return result, cost


def cpu_seconds() -> float:
    """Processor seconds so far, of all threads and of child processes that have ended."""
    spent = os.times()
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.user + spent.system + children.ru_utime + children.ru_stime


def _reset_peak() -> float:
    """MB held now; the peak is counted from here."""
    try:
        RESET.write_text("5")  # Linux: forget the peak
    except OSError:
        return float("nan")
    return _status_mb("VmRSS")


def _status_mb(name: str) -> float:
    try:
        lines = STATUS.read_text().splitlines()
    except OSError:
        return float("nan")
    return float(next(line.split()[1] for line in lines if line.startswith(name))) / 1024
