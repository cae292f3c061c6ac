"""Which processes a number means: those of one start of one kernel, in one namespace."""

from __future__ import annotations

import contextlib
import hashlib
import os
import socket
import sys
from functools import cache
from pathlib import Path

PROC = Path("/proc")
UNKNOWN = "0" * 12
"""Digits of an unidentified table of processes."""


@cache
def process_table() -> str:
    """12 hexadecimal digits of the table that this process's number is in, `UNKNOWN` where it has no name.

    Containers, and machines that were copied, have host names in common; starts of a kernel (Linux's boot ID)
    and process namespaces they have not. Other systems than Linux have neither for a process to ask.
    """
    if sys.platform != "linux":
        return UNKNOWN
    try:
        start = (PROC / "sys/kernel/random/boot_id").read_text()
        named = f"{socket.gethostname()} {start} {(PROC / 'self/ns/pid').readlink()}"
    except OSError:
        return UNKNOWN
    return hashlib.sha256(named.encode()).hexdigest()[: len(UNKNOWN)]


def is_gone(table: str, pid: int) -> bool:
    """Return whether a process has certainly ended: only processes of this table are known."""
    if UNKNOWN in (table, process_table()) or table != process_table():
        return False
    return pid != os.getpid() and not _is_alive(pid)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    # A process that has ended keeps its number until its parent waits for it. The mounted table
    # may be that of another namespace.
    with contextlib.suppress(OSError, IndexError):
        if (PROC / "self").readlink() == Path(str(os.getpid())):
            return (PROC / f"{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0] != "Z"
    return True
