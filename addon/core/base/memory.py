"""Free memory, memory errors, and the C library's reuse of memory."""

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
"""Linux's folders of processes, and of control groups, which limit containers."""
KEPT = ((-3, 2**25), (-3, 2**30), (-1, -1))
"""Options of glibc's `mallopt` and their values in bytes: M_MMAP_THRESHOLD, which some versions limit to the
first, and M_TRIM_THRESHOLD, which is off."""


def keep_freed() -> None:
    """Make the C library reuse freed memory.

    By default it returns large arrays to the system, which hands out new ones page by page: 0.64 to 0.67 of
    8.4 to 8.6 CPU s of a frame at 1920x1080 with kept depth, instead of 0.12. Peak memory grows by 2 % at
    most.
    """
    if sys.platform == "linux":
        libc = ctypes.CDLL(None)
        # Not every C library has it.
        if hasattr(libc, "mallopt"):
            for option, value in KEPT:
                libc.mallopt(option, value)


def is_shortage(error: BaseException) -> bool:
    """Return whether an exception of Python, FFmpeg, OpenCV, the system or C++ reports a lack of memory."""
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or (type(error).__module__.startswith("cv2") and getattr(error, "code", None) == -4)  # StsNoMem
        or str(error) in {"std::bad_alloc", "can't start new thread"}
    )


def shortage(what: str) -> UserError:
    """Make the error for a task that ran out of memory."""
    return UserError(
        f"{what}: there is not enough memory; close other programs, raise this one's limit (ulimit -v, its"
        " container's), or make the picture smaller"
    )


def free() -> int:
    """Measure the memory that new processes can use, in bytes.

    It is the free memory of the machine or of its container, the smaller one; on systems that do not report
    it, half of all memory.
    """
    return min([_machine_free(), *_container_free()])


def _machine_free() -> int:
    if sys.platform == "linux":
        with contextlib.suppress(OSError, ValueError):
            return 1024 * _number(PROC / "meminfo", "MemAvailable:")
    if sys.platform == "win32":
        status = (ctypes.c_uint64 * 8)()
        # MEMORYSTATUSEX: its size in 32 bits, then the load, total and free memory.
        ctypes.cast(status, ctypes.POINTER(ctypes.c_uint32))[0] = ctypes.sizeof(status)
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            return int(status[2])
        return 0
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2


def _container_free() -> Iterator[int]:
    """Yield the bytes left to this process's control group (version 2) and to each around it."""
    try:
        path = (PROC / "self" / "cgroup").read_text().partition("0::")[2].strip()
    except OSError:
        return
    # Within a container its own group is the top of the mount.
    own = GROUPS / path.lstrip("/")
    for folder in (own, *own.parents):
        with contextlib.suppress(OSError, ValueError):  # no such group, or "max"
            limit, used = (int((folder / name).read_text()) for name in ("memory.max", "memory.current"))
            # The system drops cached files when memory is short.
            cached = sum(_number(folder / "memory.stat", f"{kind}active_file") for kind in ("", "in"))
            yield max(limit - max(used - cached, 0), 0)


def _number(path: Path, name: str) -> int:
    """Read the number after a name in a system table; raises ValueError if it is missing."""
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0] == name:
            return int(words[1])
    raise ValueError(f"{path} has no {name}")
