"""Files dropped on a window, as a file manager does it: the source's side of XDND.

    python file_drop.py X Y FILE ...

The protocol is that of https://freedesktop.org/wiki/Specifications/XDND. Ends with 1 where nobody took them.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import sys
import time
from collections.abc import Iterator
from ctypes import POINTER, Structure, Union, byref, c_char_p, c_int, c_long, c_uint, c_ulong, c_void_p
from pathlib import Path

VERSION = 5
ANSWER = 15.0
"""Seconds in which the window must have answered."""
CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 33, 30, 31


class _Message(Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("sent", c_int), ("display", c_void_p), ("window", c_ulong),
        ("message", c_ulong), ("format", c_int), ("data", c_long * 5),
    )  # fmt: skip


class _Request(Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("sent", c_int), ("display", c_void_p), ("owner", c_ulong),
        ("requestor", c_ulong), ("selection", c_ulong), ("target", c_ulong), ("property", c_ulong),
        ("time", c_ulong),
    )  # fmt: skip


class _Notify(Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("sent", c_int), ("display", c_void_p), ("requestor", c_ulong),
        ("selection", c_ulong), ("target", c_ulong), ("property", c_ulong), ("time", c_ulong),
    )  # fmt: skip


class _Event(Union):
    _fields_ = (
        ("type", c_int), ("message", _Message), ("request", _Request), ("notify", _Notify),
        ("pad", c_long * 24),
    )  # fmt: skip


class Source:
    """A window that nobody sees, from which files are dragged."""

    def __init__(self, files: list[Path]) -> None:
        self._uris = "".join(f"{file.absolute().as_uri()}\r\n" for file in files).encode()
        self._x = x = ctypes.CDLL(ctypes.util.find_library("X11"))
        x.XOpenDisplay.restype = c_void_p
        for name in ("XDefaultRootWindow", "XInternAtom", "XCreateSimpleWindow"):
            getattr(x, name).restype = c_ulong
        self._display = c_void_p(x.XOpenDisplay(None))
        self._root = x.XDefaultRootWindow(self._display)
        self._window = x.XCreateSimpleWindow(
            self._display, c_ulong(self._root), 0, 0, 1, 1, 0, c_ulong(0), c_ulong(0)
        )
        self._target = next(self._aware(self._root))
        x.XSetSelectionOwner(self._display, self._atom("XdndSelection"), c_ulong(self._window), c_ulong(0))

    def drop(self, x: int, y: int) -> bool:
        """Drag the files to a place on the screen, and let go; whether the window took them."""
        place = x << 16 | y
        self._send("XdndEnter", VERSION << 24, self._atom("text/uri-list").value, 0, 0)
        for _ in range(3):
            self._send("XdndPosition", 0, place, 0, self._atom("XdndActionCopy").value)
            if not self._wait("XdndStatus"):
                return False
        self._send("XdndDrop", 0, 0, 0, 0)
        return self._wait("XdndFinished")

    def _atom(self, name: str) -> c_ulong:
        return c_ulong(self._x.XInternAtom(self._display, name.encode(), 0))

    def _aware(self, window: int) -> Iterator[int]:
        """The windows in one that take drops, the uppermost first."""
        root, parent, children, count = c_ulong(), c_ulong(), POINTER(c_ulong)(), c_uint()
        self._x.XQueryTree(
            self._display, c_ulong(window), byref(root), byref(parent), byref(children), byref(count)
        )
        for child in reversed(children[: count.value]):
            kind, bits, length, left, data = c_ulong(), c_int(), c_ulong(), c_ulong(), c_char_p()
            self._x.XGetWindowProperty(
                self._display, c_ulong(child), self._atom("XdndAware"), c_long(0), c_long(1), 0, c_ulong(0),
                byref(kind), byref(bits), byref(length), byref(left), byref(data),
            )  # fmt: skip
            if kind.value:
                yield child
            yield from self._aware(child)

    def _send(self, name: str, *data: int) -> None:
        event = _Event()
        event.message = _Message(
            CLIENT_MESSAGE, 0, 1, self._display, self._target, self._atom(name).value, 32,
            (c_long * 5)(self._window, *data),
        )  # fmt: skip
        self._x.XSendEvent(self._display, c_ulong(self._target), 0, c_long(0), byref(event))
        self._x.XFlush(self._display)

    def _wait(self, name: str) -> bool:
        """Whether a message of this name came; meanwhile the files are told to who asks."""
        wanted, until = self._atom(name).value, time.monotonic() + ANSWER
        event = _Event()
        while time.monotonic() < until:
            if not self._x.XPending(self._display):
                time.sleep(0.01)
                continue
            self._x.XNextEvent(self._display, byref(event))
            if event.type == SELECTION_REQUEST:
                self._tell(event.request)
            elif event.type == CLIENT_MESSAGE and event.message.message == wanted:
                return True
        return False

    def _tell(self, request: _Request) -> None:
        window, where = c_ulong(request.requestor), c_ulong(request.property)
        self._x.XChangeProperty(
            self._display, window, where, c_ulong(request.target), 8, 0, self._uris, len(self._uris)
        )
        event = _Event()
        event.notify = _Notify(
            SELECTION_NOTIFY, 0, 1, self._display, request.requestor, request.selection, request.target,
            request.property, request.time,
        )  # fmt: skip
        self._x.XSendEvent(self._display, window, 0, c_long(0), byref(event))
        self._x.XFlush(self._display)


if __name__ == "__main__":
    across, down, *named = sys.argv[1:]
    sys.exit(0 if Source([Path(name) for name in named]).drop(int(across), int(down)) else 1)
