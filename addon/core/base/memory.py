"""Hard limits of this process's memory, and what is known to need more than they allow.

Recognising a shortage after the fact is not enough: Blender, Mesa, FFmpeg and OpenBLAS do not check whether
they were given the memory that they asked for, and crash or are killed where a limit is met, so that no line
of ours is reached. Hence what they need at least was measured, and a limit below it is refused ahead, as a
farm's containers and `ulimit -v` set them. Only the standard library is imported here: the first check comes
before Blender and NumPy are loaded.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from .errors import UserError

MB = 2**20
PROC, GROUPS = Path("/proc"), Path("/sys/fs/cgroup")
ONE_ARENA = -8
"""M_ARENA_MAX of glibc's malloc.h."""
KEPT = ((-3, 2**25), (-3, 2**30), (-1, -1))
"""M_MMAP_THRESHOLD of it, in bytes, of which some versions take no more than the first; and M_TRIM_THRESHOLD,
so that nothing that is freed is given back."""
CPUS = 2
"""The most processors that are counted: each has threads, whose stacks and buffers take address space. It was
measured with one and two; more than two take more, which is not known and so refuses nothing."""
SCARCE = 256 * MB
"""Bytes of address space left under which a video that cannot be opened or decoded is put down to memory. Of
96 x 54 pixels, with 2 processors, FFmpeg fails with 16 MB left and works with 20 (tests/base/test_memory.py
has the way); of 4K a frame takes 12 MB, and some 20 are held."""
NO_LIMIT = 2**60
"""Bytes from which on a control group has no limit: the first version writes a number near 2^63 for none."""


@dataclass(frozen=True)
class Need:
    """What something takes at its peak, at least, together with the program that does it."""

    mapped: int
    """Bytes of address space with one processor."""
    mapped_for_each: int
    """Bytes of address space for each further processor."""
    own: int
    """Bytes of memory that is no file's, RssAnon in Linux's words."""

    def address_space(self) -> int:
        """Bytes of address space on this machine."""
        return self.mapped + (min(_processors(), CPUS) - 1) * self.mapped_for_each


PROGRAM = Need(1684 * MB, 180 * MB, 112 * MB)
"""Blender as a module, OpenCV and the add-on, loaded. As the other two it is the least limit with which a
command (here `report`) ended well on the torture's clip of 96 x 54 pixels, with one processor (taskset) and
with two; limits 2 to 12 MB apart were tried, of address space and of a control group. Below it Blender
crashed, a library had the last word, or the system ended it."""
DRAWING = Need(1988 * MB, 244 * MB, 190 * MB)
"""The least for `render`, found as `PROGRAM` was, with Mesa's software OpenGL and a mask. The method of
features needs 28 MB less of address space; of memory it is features' own need."""
MOVIE = Need(2064 * MB, 260 * MB, 196 * MB)
"""The least for `render` into an .mp4, found as `PROGRAM` was, whose encoder's threads come last."""
A_PIXEL = 115
"""Bytes for each pixel of a larger picture, of address space and of memory alike, by the method of features:
`python -m benchmarks.timings.memory_peaks` gives 126 to 140 from 1920x1080 to 7680x4320, layers take 159 to
187. A disc of a pixel takes 5 less, and the share falls slowly with the size; this is below them all."""


def keep_to_one_arena() -> None:
    """Where the address space is limited, have the C library set no more of it aside than it uses.

    glibc gives each thread 64 MB of addresses to allocate from. With one arena for all of them a tiny clip is
    rendered within 2.05 GiB; with one each it sometimes needs 2.7. Threads that are there keep theirs.
    """
    if address_limit() is not None:
        _set_allocator((ONE_ARENA, 1))


def keep_freed() -> None:
    """Have the C library keep what is freed, for what is allocated next.

    It gives large arrays back to the system, which hands each new one out page by page: of a frame at
    1920x1080 whose depth is kept that was 0.64 to 0.67 of 8.4 to 8.6 CPU s, and is 0.12, for at most 2 % more
    memory at the peak (runs of `benchmarks.timings.whole_runs`, system time told apart; scratch script).
    Where the address space is limited, what is needed was measured without it.
    """
    if sys.platform == "linux" and address_limit() is None:
        _set_allocator(*KEPT)


def _set_allocator(*options: tuple[int, int]) -> None:
    """Set options of the C library's allocator, by their numbers in glibc, to values."""
    libc = ctypes.CDLL(None)
    # Not every C library has it.
    if hasattr(libc, "mallopt"):
        for option, value in options:
            libc.mallopt(option, value)


def check(what: str, need: Need, pixels: int = 0) -> None:
    """UserError where a hard limit is below what a thing needs, with a picture of so many pixels."""
    limit, needed = address_limit(), need.address_space() + A_PIXEL * pixels
    if limit is not None and limit < needed:
        raise UserError(
            f"{what} takes at least {_gib(needed)} of address space, and this process may have"
            f" {_gib(limit)}: raise the limit (ulimit -v){_smaller(limit >= need.address_space())}"
        )
    limit, needed = memory_limit(), need.own + A_PIXEL * pixels
    if limit is not None and limit < needed:
        raise UserError(
            f"{what} takes at least {_gib(needed)} of memory, and its container leaves {_gib(limit)}: raise"
            f" the container's limit, or run less beside{_smaller(limit >= need.own)}"
        )


def is_scarce() -> bool:
    """Whether so little of a limited address space is left that even small things fail."""
    limit = address_limit()
    return limit is not None and limit - _mapped() < SCARCE


def is_shortage(error: BaseException) -> bool:
    """Whether an exception says that memory ran out: Python's, OpenCV's, the system's or C++'s."""
    return (
        isinstance(error, MemoryError)
        or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
        or (type(error).__module__.startswith("cv2") and getattr(error, "code", None) == -4)  # StsNoMem
        or str(error) in {"std::bad_alloc", "can't start new thread"}
    )


def shortage(what: str) -> UserError:
    """The error for the user where memory ran out: `what` could not be done."""
    limits = [f"{_gib(limit)}, {word}" for limit, word in _limits() if limit is not None]
    allowed = f" (it may have {' and '.join(limits)})" if limits else ""
    return UserError(
        f"{what}: there is not enough memory for this process{allowed}; raise the limit, run less beside, or"
        " make the picture smaller"
    )


def free() -> int:
    """Bytes of memory that are free for more processes: of the machine, and by its control groups; half of
    what the machine has where it does not tell what is free."""
    limit = memory_limit()
    return min(_machine_free(), limit if limit is not None else NO_LIMIT)


def _machine_free() -> int:
    if sys.platform == "linux":
        with contextlib.suppress(OSError, ValueError):
            return 1024 * _number(PROC / "meminfo", "MemAvailable:")
    if sys.platform == "win32":
        status = (ctypes.c_uint64 * 8)()
        # MEMORYSTATUSEX: its own length in 32 bits, then the load, the whole and the free memory.
        ctypes.cast(status, ctypes.POINTER(ctypes.c_uint32))[0] = ctypes.sizeof(status)
        if ctypes.windll.kernel32.GlobalMemoryStatusEx(ctypes.byref(status)):
            return int(status[2])
        return 0
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2


def _limits() -> Iterator[tuple[int | None, str]]:
    yield address_limit(), "by ulimit -v"
    yield memory_limit(), "by its container"


def address_limit() -> int | None:
    """Bytes of address space that this process may have (RLIMIT_AS); None without a limit, and elsewhere than
    on Linux.
    """
    if sys.platform != "linux":
        return None
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def memory_limit(proc: Path = PROC, groups: Path = GROUPS) -> int | None:
    """Bytes of memory that this process may have by its control groups, less what others in them hold.

    Caches of files are given back when memory is short and do not count. None without a limit, where there
    is swap, which makes limits soft, and elsewhere than on Linux.
    """
    if sys.platform != "linux":
        return None
    try:
        if _number(proc / "meminfo", "SwapTotal:") > 0:
            return None
        own = 1024 * _number(proc / "self" / "status", "RssAnon:")
        lines = (proc / "self" / "cgroup").read_text().splitlines()
    except (OSError, ValueError):
        return None
    left: list[int] = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            left += _left(groups, path, "memory.max", "memory.current", "")
        elif "memory" in controllers.split(","):
            names = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"
            left += _left(groups / "memory", path, *names)
    return own + min(left) if left else None


def _left(mount: Path, path: str, limit: str, usage: str, prefix: str) -> Iterator[int]:
    """Bytes that a control group and each of those it lies in could still be given."""
    group = mount / path.lstrip("/")
    # Within a container its own group is the mount's top, whatever it is called outside.
    for folder in [group, *group.parents]:
        if folder.is_relative_to(mount):
            try:
                most = int((folder / limit).read_text())
                used = int((folder / usage).read_text())
                cached = sum(
                    _number(folder / "memory.stat", f"{prefix}{state}_file")
                    for state in ("active", "inactive")
                )
            except (OSError, ValueError):
                continue  # no such group, or "max"
            if most < NO_LIMIT:
                yield most - max(used - cached, 0)


def _number(path: Path, name: str) -> int:
    """The number behind a name in one of the system's tables; ValueError where it has none."""
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0] == name:
            return int(words[1])
    raise ValueError(f"{path} has no {name}")


def _mapped() -> int:
    return int((PROC / "self" / "statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def _processors() -> int:
    return os.process_cpu_count() or 1


def _smaller(helps: bool) -> str:
    return ", or make the picture smaller" if helps else ""


def _gib(size: int) -> str:
    return f"{max(size, 0) / 2**30:.2f} GiB"
