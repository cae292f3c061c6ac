"""Answers to the calls of functions by the parent process (`worker.Call`), one after the other."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from pathlib import Path

from . import memory
from .errors import UserError
from .messages import Parcel, Progress, is_cancelled, next_call, send
from .parcel import Named, no_name, pack
from .progress import Cancelled, reporting
from .worker import tend

LOOK = 1.0
"""Seconds between two looks at processes that this one has left."""
APART = 0.05
"""Seconds between two messages about progress."""
_show: Callable[[object], None] | None = None
"""Shows something to the process that waits for the present call."""


def show(value: object) -> None:
    """Show something to the process that has called the present function, if one has."""
    if _show is not None:
        _show(value)


def serve(thing: Named = no_name) -> None:
    """Answer calls until the process is ended; `thing` as of `unpack`."""
    while True:
        call = next_call(LOOK)
        tend()
        if call is not None:
            _answer(call, thing)


def _answer(call: Parcel, thing: Named) -> None:
    """Call a function, and send its result or error."""
    global _show
    shown, reported = 0, 0.0

    def on_progress(stage: str, share: float) -> None:
        nonlocal reported
        if is_cancelled(call.call):
            raise Cancelled
        now = time.monotonic()
        if now - reported > APART:
            reported = now
            send(Progress(stage, 1, 1, share=share, call=call.call))

    def answer(data: bytes, is_last: bool) -> None:
        nonlocal shown
        shown += 1
        file = Path(f"{call.file}.{shown}")
        file.write_bytes(data)
        send(Parcel(call.call, str(file), is_last))

    try:
        _show = lambda value: answer(pack(value), False)  # noqa: E731
        function = call.take(thing)
        with reporting(on_progress):
            on_progress("", 0.0)
            value = function()
        data = pack((None, [value]))
    except Exception as error:
        data = pack((_sendable(error), []))
    finally:
        _show = None
    answer(data, True)


def _sendable(error: Exception) -> Exception:
    """Return an error of ours for one that was raised."""
    if isinstance(error, (Cancelled, UserError)):
        return error
    if memory.is_shortage(error):
        return memory.shortage("it could not be finished")
    return Failed(f"{type(error).__name__}: {error}", traceback.format_exc())


class Failed(Exception):  # noqa: N818
    """A bug in a function that another process called: its class and text, and the traceback."""
