"""Output of commands, which continue when their reader is gone.

A render whose lines went to `head -1` or to a closed terminal is finished. After other failures, such as a
full disk, the work continues, too, and `check` reports them.
"""

import contextlib
import errno
import os
import sys

from .errors import UserError

GONE = {errno.EPIPE, errno.EIO, errno.EBADF}
"""Error numbers of a pipe without a reader, a terminal that hung up, and a missing stream."""
_lost = ""
"""The first error in writing other than `GONE`, or empty."""


def open_all() -> None:
    """Open those of the three standard streams that the process was started without (`>&-`).

    Otherwise files opened later would get their numbers, and receive the output of libraries.
    """
    global _lost
    _lost = ""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest free number is this one.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def say(text: str) -> None:
    """Print a line on standard output at once."""
    try:
        print(text, flush=True)
    except OSError as error:
        _silence(1, error)


def say_to(descriptor: int, text: str) -> None:
    """Write a line to a file descriptor."""
    try:
        os.write(descriptor, f"{text}\n".encode())
    except OSError as error:
        _silence(descriptor, error)


def complain(text: str) -> None:
    """Print an error on standard error, on one line."""
    try:
        print(f"error: {' '.join(text.split('\n'))}", file=sys.stderr, flush=True)
    except OSError as error:
        _silence(2, error)


def check() -> None:
    """Raise UserError if lines were lost for a reason other than a missing reader."""
    flush()
    if _lost:
        raise UserError(f"standard output cannot be written: {_lost}; all else is complete")


def flush() -> None:
    """Flush both streams."""
    for descriptor, stream in ((1, sys.stdout), (2, sys.stderr)):
        try:
            stream.flush()
        except OSError as error:
            _silence(descriptor, error)


def _silence(descriptor: int, error: OSError) -> None:
    """Redirect a descriptor to the null device, with the stream's buffered text."""
    global _lost
    if error.errno not in GONE:
        _lost = _lost or str(error.strerror)
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
