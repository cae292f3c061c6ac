"""The user's limits: threads and bytes of kept depth. Child processes inherit them from the environment."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

from .numbers import whole

THREADS = "VIRTUAL_APERTURE_THREADS"
KEPT_DEPTH = "VIRTUAL_APERTURE_KEPT_DEPTH"
OPENCV_THREADS = "OPENCV_FOR_THREADS_NUM"
"""OpenCV's own variable, read when it is loaded."""
ONE_THREAD = {THREADS: "1", OPENCV_THREADS: "1", "LP_NUM_THREADS": "0"}
"""Environment of processes that share the processors: two threads within a frame take a sixth more processor
time and save a twentieth of the time. With 0, Mesa's software renderer draws in the caller's thread: 4 % less
processor time and 50 MB less."""
MOST_KEPT_DEPTH = 8 << 30
"""Default bytes: about an hour of video at 640x360, or twelve minutes of a phone's."""


def threads() -> int:
    """Return the number of parallel threads: that of processors, or fewer if the user has limited it."""
    processors = os.process_cpu_count() or 1
    return min(processors, chosen_threads() or processors)


def chosen_threads() -> int:
    """Return the user's limit of threads, or 0."""
    return _number(THREADS)


def limit_threads(most: int) -> None:
    """Limit the number of parallel threads; 0 removes the limit."""
    if not most and THREADS not in os.environ:
        # The user's own setting for OpenCV stays.
        return
    _say(THREADS, most)
    _say(OPENCV_THREADS, most)
    # A negative number restores OpenCV's default.
    cv2.setNumThreads(threads() if most else -1)


@contextmanager
def one_thread() -> Iterator[None]:
    """Use a single thread within the context."""
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
    """Return the most bytes of kept depth a clip."""
    return _number(KEPT_DEPTH) or MOST_KEPT_DEPTH


def limit_kept_depth(most: int) -> None:
    """Limit the bytes of kept depth a clip; 0 restores the default."""
    _say(KEPT_DEPTH, most)


def _number(name: str) -> int:
    """Read a number of the environment; 0 if it is missing or invalid."""
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
