"""Messages from a child process to its parent: one a line, as JSON, on its standard output.

>>> decode(encode(Progress("depth", 3, 118)))
Progress(stage='depth', done=3, total=118, frame=None, share=None)
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TextIO

from .errors import Remedy, UserError


@dataclass(frozen=True)
class Progress:
    """How far a stage of the work is."""

    stage: str
    done: int
    total: int
    """Steps of the stage."""
    frame: int | None = None
    """The number of the frame that is whole now, where each step is a frame."""
    share: float | None = None
    """Share of the whole work in [0, 1], if the stage is a part of it."""


@dataclass(frozen=True)
class Warned:
    """Something that the user should know of work that goes on."""

    text: str


@dataclass(frozen=True)
class Seen:
    """The input of a stage of the work, for the waiting user: a frame, and features found in it."""

    picture: str
    """The frame, small, as JPEG in base 64."""
    places: list[list[float]]
    """x and y of the features as fractions of the picture, (0, 0) top left."""


@dataclass(frozen=True)
class Result:
    """All that was asked for is done: whole and in its place."""


@dataclass(frozen=True)
class Failure:
    """Why the work was not done."""

    text: str
    """One line for the user."""
    code: int = 1
    """The exit status that goes with it."""
    remedies: tuple[Remedy, ...] = ()
    traceback: str = ""
    """Traceback of a bug; empty for a `UserError`."""

    @property
    def error(self) -> UserError:
        """The same as an error; a bug's traceback is its cause."""
        error = UserError(self.text, *self.remedies)
        error.__cause__ = RuntimeError(self.traceback) if self.traceback else None
        return error


Message = Progress | Warned | Seen | Result | Failure
_KINDS: dict[str, type[Message]] = {
    "progress": Progress, "warning": Warned, "seen": Seen, "result": Result, "error": Failure,
}  # fmt: skip
_NAMES = {kind: name for name, kind in _KINDS.items()}


def encode(message: Message) -> str:
    """A message as a line of JSON, without the line's end."""
    return json.dumps({"message": _NAMES[type(message)], **asdict(message)})


def decode(line: str) -> Message | None:
    """The message of a line; None for a line that is none, such as what a library prints."""
    try:
        held = json.loads(line)
        kind = _KINDS[held.pop("message")]
        if kind is Failure:
            held["remedies"] = tuple(map(Remedy, held["remedies"]))
        return kind(**held)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


_parent: TextIO | None = None
"""Stream of messages; None in a process that people started."""


PATIENCE = 10.0
"""Seconds from the request to end until a process is killed."""


def end_itself() -> None:
    """End this process, at first politely.

    Code outside of Python, such as Cycles in a render, hears no signal while it works.
    """
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE)
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


def speak(when_alone: Callable[[], object] = end_itself) -> None:
    """Turn this process into a child of its parent, as `Job` expects.

    Standard output is for messages alone; other output to it is discarded.

    Args:
        when_alone: Called on a thread when standard input closes, as it does when the parent has ended; by
            default the process ends.
    """
    global _parent
    sys.stdout.flush()
    _parent = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)

    def watch() -> None:
        while os.read(0, 1):
            pass
        when_alone()

    threading.Thread(target=watch, daemon=True).start()


def send(message: Message) -> None:
    """Tell the parent; nothing where people started this process, or the parent is gone."""
    if _parent is not None:
        with contextlib.suppress(OSError):
            _parent.write(f"{encode(message)}\n")
            _parent.flush()
