"""Functions of ours that Blender calls while the extension is registered: at its events, and by timers."""

from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

Handler = Callable[..., object]
Tick = Callable[[], float | None]
RENDERS = "render_init", "render_complete", "render_cancel", "load_pre"
"""A render begins, ends or is cancelled, or another file is opened: state of a render ends."""
_called: list[tuple[str, Handler]] = []
_ticks: list[Tick] = []


def at[F: Handler](*events: str) -> Callable[[F], F]:
    """Return a decorator of functions that Blender calls at events, in whichever .blend is open.

    The events are the names of lists in `bpy.app.handlers`.
    """

    def listed(function: F) -> F:
        _called.extend((event, persistent(function)) for event in events)
        return function

    return listed


def watch(tick: Tick, seconds: float, stays: bool = False) -> None:
    """Have a function called after some seconds, and again as it asks for, unless it is called already.

    It `stays` where another file is opened.
    """
    if not bpy.app.timers.is_registered(tick):
        _ticks[:] = [*filter(bpy.app.timers.is_registered, _ticks), tick]
        bpy.app.timers.register(tick, first_interval=seconds, persistent=stays)


def register() -> None:
    """Have Blender call from now on."""
    for event, function in _called:
        getattr(bpy.app.handlers, event).append(function)


def unregister() -> None:
    """Undo `register`, and end all timers."""
    for event, function in _called:
        getattr(bpy.app.handlers, event).remove(function)
    for tick in filter(bpy.app.timers.is_registered, _ticks):
        bpy.app.timers.unregister(tick)
