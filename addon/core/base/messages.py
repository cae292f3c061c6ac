"""Messages between a child process and its parent: one a line, as JSON, on standard input and output.

>>> decode(encode(Progress("depth", 3, 118)))
Progress(stage='depth', done=3, total=118, frame=None, share=None)
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, get_args

from .errors import Remedy, UserError
from .parcel import Named, no_name, unpack


@dataclass(frozen=True)
class Progress:
    """The progress of a stage; before its first step, `stage` names the work under way in a few words."""

    stage: str
    done: int
    total: int
    """Steps of the stage."""
    frame: int | None = None
    """Number of the finished frame, if each step is a frame."""
    share: float | None = None
    """Finished share of the whole work in [0, 1], if the stage is a part of it."""
    call: int | None = None
    """Number of the call that makes the progress, if it is one's."""


@dataclass(frozen=True)
class Warned:
    """A warning for the user; the work goes on."""

    text: str


@dataclass(frozen=True)
class Result:
    """The work is done, and its files are complete and in place."""


@dataclass(frozen=True)
class Failure:
    """The reason why the work was not done."""

    text: str
    """One line for the user."""
    remedies: tuple[Remedy, ...] = ()

    @property
    def error(self) -> UserError:
        """The failure as an error."""
        return UserError(self.text, *self.remedies)


@dataclass(frozen=True)
class Parcel:
    """A value in a file (`parcel.pack`): a function to call, what it shows, or its error and result."""

    call: int
    """Number of the call; that of the request that a process is started with is 0."""
    file: str
    is_last: bool = True
    """False for a value that is shown before the result."""

    def take(self, thing: Named = no_name) -> Any:
        """Return the value and remove the file; `thing` as of `unpack`."""
        file = Path(self.file)
        data = file.read_bytes()
        file.unlink()
        return unpack(data, thing)


@dataclass(frozen=True)
class Cancel:
    """Nobody waits for a call any longer."""

    call: int


Message = Progress | Warned | Result | Failure | Parcel | Cancel
_KINDS: dict[str, type[Message]] = {kind.__name__: kind for kind in get_args(Message)}


def encode(message: Message) -> str:
    """Convert a message to a line of JSON, without the end of line."""
    return json.dumps({"message": type(message).__name__, **asdict(message)})


def decode(line: str) -> Message | None:
    """Read a message; None for another line, such as a library's output."""
    try:
        held = json.loads(line)
        kind = _KINDS[held.pop("message")]
        if kind is Failure:
            held["remedies"] = tuple(map(Remedy, held["remedies"]))
        return kind(**held)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


_parent: IO[bytes] | None = None
"""Stream for messages; None in a process without a parent of ours."""
_requests: Any = None
"""Queue of the parcels that have come."""
_cancelled: set[int] = set()
"""Calls that nobody waits for."""
PATIENCE = 10.0
"""Seconds after which a process that was asked to end is killed."""


def end_itself() -> None:
    """End this process by SIGTERM, then SIGKILL: native code, such as a Cycles render, ignores signals."""
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE)
    os.kill(os.getpid(), getattr(signal, "SIGKILL", signal.SIGTERM))


def speak(when_alone: Callable[[], object] = end_itself) -> None:
    """Become a child process of the kind that `Worker` starts.

    Standard output is then for messages alone; other output is dropped. `when_alone` is called in a thread
    when standard input closes, because the parent has ended; by default the process ends.
    """
    global _parent, _requests
    sys.stdout.flush()
    _parent = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    # Only such a process has a thread.
    import threading
    from queue import SimpleQueue

    requests = _requests = SimpleQueue[Parcel]()

    def listen() -> None:
        # Without a buffer: its lock would outlive this thread.
        with open(0, "rb", buffering=0, closefd=False) as lines:
            for message in (decode(line.decode()) for line in lines):
                if isinstance(message, Parcel):
                    requests.put(message)
                elif isinstance(message, Cancel):
                    _cancelled.add(message.call)
        when_alone()

    threading.Thread(target=listen, daemon=True).start()


def told() -> Any:
    """Wait for the request that this process was started with, and return its value."""
    return _requests.get().take()


def next_call(seconds: float) -> Parcel | None:
    """Return the parent's next call; None without one for so many seconds."""
    from queue import Empty

    try:
        call: Parcel = _requests.get(timeout=seconds)
    except Empty:
        return None
    return call


def is_cancelled(call: int) -> bool:
    """Return whether nobody waits for a call any longer."""
    return call in _cancelled


def send(message: Message) -> None:
    """Send a message to the parent, if there is one."""
    if _parent is not None:
        write(_parent, message)


def write(stream: IO[bytes], message: Message) -> None:
    """Write a message; the end of its reader is noticed elsewhere."""
    with contextlib.suppress(OSError):
        stream.write(f"{encode(message)}\n".encode())
        stream.flush()
