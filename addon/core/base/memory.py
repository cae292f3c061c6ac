"""Memory: free bytes, exhaustion, and reuse by the C library."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from .errors import UserError

MB = 2**20
PROC, GROUPS = Path("/proc"), Path("/sys/fs/cgroup")
KEPT = ((-3, 2**25), (-3, 2**30), (-1, -1))
"""Options of glibc's `mallopt` and their values: M_MMAP_THRESHOLD in bytes, of which some versions take no
more than the first, and M_TRIM_THRESHOLD, which is off."""


def keep_freed() -> None:
    """Make the C library keep freed memory for later allocations.

    It otherwise returns large arrays to the system, which hands out each new one page by page: 0.64 to 0.67
    of 8.4 to 8.6 CPU seconds of a frame at 1920x1080 with kept depth, instead of 0.12. Memory at the peak
    grows by 2 % at most.
    """
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        # Not every C library has it.
        if hasattr(libc, "mallopt"):
            for option, value in KEPT:
                libc.mallopt(option, value)


def is_shortage(error: BaseException) -> bool:
    """Whether an exception reports that memory ran out, of Python, FFmpeg, OpenCV, the system or C++."""
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or (type(error).__module__.startswith("cv2") and getattr(error, "code", None) == -4)  # StsNoMem
        or str(error) in {"std::bad_alloc", "can't start new thread"}
    )


def shortage(what: str) -> UserError:
    """Make the error for the user where memory ran out: `what` could not be done."""
    return UserError(
        f"{what}: there is not enough memory; close other programs, raise this one's limit (ulimit -v, its"
        " container's), or make the picture smaller"
    )


def free(proc: Path = PROC, groups: Path = GROUPS) -> int:
    """Return the bytes of memory that are free for more processes, on this machine and in its container.

    Half of the machine's memory if the system does not report free memory.
    """
    return min([_machine_free(proc), *_container_free(proc, groups)])


def _machine_free(proc: Path) -> int:
    if sys.platform == "linux":
        with contextlib.suppress(OSError, ValueError):
            return 1024 * _number(proc / "meminfo", "MemAvailable:")
    if sys.platform == "win32":
        status = (ctypes.c_uint64 * 8)()
        # MEMORYSTATUSEX: its own length in 32 bits, then the load, the whole and the free memory.
        ctypes.cast(status, ctypes.POINTER(ctypes.c_uint32))[0] = ctypes.sizeof(status)
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            return int(status[2])
        return 0
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2


def _container_free(proc: Path, groups: Path) -> Iterator[int]:
    """Bytes that this process's control group (version 2), and each around it, may still be given."""
    try:
        path = (proc / "self" / "cgroup").read_text().partition("0::")[2].strip()
    except OSError:
        return
    # Within a container its own group is the mount's top, whatever it is called outside.
    own = groups / path.lstrip("/")
    for folder in (own, *own.parents):
        with contextlib.suppress(OSError, ValueError):  # no such group, or "max"
            limit, used = (int((folder / name).read_text()) for name in ("memory.max", "memory.current"))
            # Files that are cached are dropped when memory is short.
            cached = sum(_number(folder / "memory.stat", f"{kind}active_file") for kind in ("", "in"))
            yield max(limit - max(used - cached, 0), 0)


def _number(path: Path, name: str) -> int:
    """The number behind a name in one of the system's tables; ValueError where it has none."""
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0] == name:
            return int(words[1])
    raise ValueError(f"{path} has no {name}")
