"""The user's limits of threads and of room for kept depth.

They are in the environment, so that child processes have them, too.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

from .numbers import whole

THREADS = "VIRTUAL_APERTURE_THREADS"
KEPT_DEPTH = "VIRTUAL_APERTURE_KEPT_DEPTH"
OPENCV_THREADS = "OPENCV_FOR_THREADS_NUM"
"""OpenCV's own, which it reads when it is loaded."""
ONE_THREAD = {THREADS: "1", OPENCV_THREADS: "1", "LP_NUM_THREADS": "0"}
"""The environment of processes that share a machine's processors: two threads within a frame take a sixth
more processor time and gain a twentieth of the time. The last is Mesa's software renderer's, which draws in
a thread beside the caller's with 1: with 0 it takes 4 % less processor time and 50 MB less."""
MOST_KEPT_DEPTH = 8 << 30
"""Bytes by default: about an hour of video at 640x360, twelve minutes of a phone's. Chosen by inspection."""


def threads() -> int:
    """Return the number of threads: the processors, or the user's limit."""
    processors = os.process_cpu_count() or 1
    return min(processors, chosen_threads() or processors)


def chosen_threads() -> int:
    """Return the user's limit of threads; 0 without one."""
    return _number(THREADS)


def limit_threads(most: int) -> None:
    """Have at most so many threads work side by side, from now on; 0 for as many as processors."""
    if not most and THREADS not in os.environ:
        # The user's setting of OpenCV stays.
        return
    _say(THREADS, most)
    _say(OPENCV_THREADS, most)
    # A negative number stands for OpenCV's own choice.
    cv2.setNumThreads(threads() if most else -1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Have one thread at a time work within."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    threads_before = cv2.getNumThreads()
    os.environ.update(ONE_THREAD)
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value
        cv2.setNumThreads(threads_before)


def most_kept_depth() -> int:
    """Bytes that the kept depth of a clip may take."""
    return _number(KEPT_DEPTH) or MOST_KEPT_DEPTH


def limit_kept_depth(most: int) -> None:
    """Limit the bytes of a clip's kept depth; 0 for the default."""
    _say(KEPT_DEPTH, most)


def _number(name: str) -> int:
    """The number in a variable of the environment; 0 where there is none, or no number."""
    text = os.environ.get(name, "")
    try:
        return max(whole(text), 0)
    except ValueError:
        return 0


def _say(name: str, value: int) -> None:
    if value > 0:
        os.environ[name] = str(value)
    else:
        os.environ.pop(name, None)
