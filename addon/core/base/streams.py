"""Output to the person or program that runs a command, which may be gone.

The files of a command matter, so it continues without a listener: a render whose output went to `head -1`, or
to a closed terminal, is finished. Output that cannot be kept for another reason, such as a full disk, does
not stop the work either; `check` reports it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import sys

from .errors import UserError

GONE = {errno.EPIPE, errno.EIO, errno.EBADF}
"""Errors of the system without a listener: a pipe without a reader, a hung up terminal, no stream."""

_lost = ""
"""Why lines could not be written, other than that nobody listens; empty where all were."""


def open_all() -> None:
    """Open the standard streams that the process was started without (`>&-`).

    Files opened later would get their numbers, and output of libraries would be written into them.
    """
    global _lost
    _lost = ""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest number that is free is this one.
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def say(text: str) -> None:
    """A line on standard output, at once."""
    try:
        print(text, flush=True)
    except OSError as error:
        _silence(1, error)


def say_to(descriptor: int, text: str) -> None:
    """A line to a file descriptor."""
    try:
        os.write(descriptor, f"{text}\n".encode())
    except OSError as error:
        _silence(descriptor, error)


def complain(text: str) -> None:
    """An error on standard error, as one line whatever is in it."""
    try:
        print(f"error: {' '.join(text.split('\n'))}", file=sys.stderr, flush=True)
    except OSError as error:
        _silence(2, error)


def check() -> None:
    """Check that no output was lost.

    Raises:
        UserError: Lines for a listener were lost.
    """
    flush()
    if _lost:
        raise UserError(f"standard output cannot be written: {_lost}; the command has done all else")


def flush() -> None:
    """Write what the streams still hold."""
    for descriptor, stream in ((1, sys.stdout), (2, sys.stderr)):
        try:
            stream.flush()
        except OSError as error:
            _silence(descriptor, error)


def _silence(descriptor: int, error: OSError) -> None:
    """Discard further output to a descriptor, and the content of a stream's buffer."""
    global _lost
    if error.errno not in GONE:
        _lost = _lost or str(error.strerror)
    with contextlib.suppress(OSError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)
