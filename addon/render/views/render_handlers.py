"""Blender's handlers for state that lasts from one render to the next."""

import contextlib
from collections.abc import Callable

import bpy

NAMES = "render_init", "render_complete", "render_cancel", "load_pre"
"""Lists of handlers: a render begins, ends or is cancelled, or another file is opened."""


def add(handler: Callable[..., None]) -> None:
    """Have a persistent handler called at each of `NAMES`."""
    for name in NAMES:
        getattr(bpy.app.handlers, name).append(handler)


def remove(handler: Callable[..., None]) -> None:
    """Undo `add`; harmless where that was not called."""
    for name in NAMES:
        with contextlib.suppress(ValueError):
            getattr(bpy.app.handlers, name).remove(handler)
