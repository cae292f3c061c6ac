"""What goes wrong while something is written."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager

from addon.render import engine


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """No file can grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handled = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handled)


@contextmanager
def interrupted(at: int) -> Iterator[None]:
    """Ctrl-C arrives while this frame is drawn."""
    drawn = engine.render_frame

    def stops(taken: object, frame: int, *rest: object) -> object:
        if frame == at:
            raise KeyboardInterrupt
        return drawn(taken, frame, *rest)

    engine.render_frame = stops
    try:
        yield
    finally:
        engine.render_frame = drawn
