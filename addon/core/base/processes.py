"""Identification of processes: numbers are unique within one boot of a kernel and one namespace."""

import contextlib
import hashlib
import os
import sys
from functools import cache
from pathlib import Path

PROC = Path("/proc")
UNKNOWN = "0" * 12
"""Digits for a table that cannot be identified."""


def host_name() -> str:
    """Return the name of this machine; empty if the system does not report it."""
    return os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")


@cache
def process_table() -> str:
    """Return 12 hexadecimal digits of this process's table, or `UNKNOWN`.

    Containers and copied machines share host names, but not boot IDs of Linux and process namespaces. Other
    systems report neither.
    """
    if sys.platform != "linux":
        return UNKNOWN
    try:
        start = (PROC / "sys/kernel/random/boot_id").read_text()
        named = f"{host_name()} {start} {(PROC / 'self/ns/pid').readlink()}"
    except OSError:
        return UNKNOWN
    return hashlib.sha256(named.encode()).hexdigest()[: len(UNKNOWN)]


def is_gone(table: str, pid: int) -> bool:
    """Return whether a process of this process's own table has certainly ended."""
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
    # A zombie still has its number. The mounted table may be another namespace's.
    with contextlib.suppress(OSError, IndexError):
        if (PROC / "self").readlink() == Path(str(os.getpid())):
            return (PROC / f"{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0] != "Z"
    return True
