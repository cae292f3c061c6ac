"""Work on Blender's main thread, in slices, while Blender's render thread waits for the result.

With a window open, a render thread that holds the GPU stops the main thread at its next redraw: the
interface would freeze and never see ESC. So the main thread itself draws, a little between its own events.
"""

import time
from _thread import get_ident
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu

from ...core.base.progress import Cancelled, checkpoint
from ...core.base.worker import tend
from ..base import redraw

type Steps[T] = Generator[int, None, T]
"""Yields how many steps are done, returns what they make. Between two of them another window's GPU context
may become the active one: nothing that belongs to a context (framebuffers) may be kept from one to the
next."""
SLICE = 0.04
"""Seconds of drawing between two looks at the interface's events."""
IDLE = 0.02
"""Seconds between two looks for work."""
LOOK = 0.002
"""Seconds between two looks of the thread that waits."""


@dataclass
class _Job[T]:
    """One frame's drawing, or what else is done, shared by the two threads."""

    steps: Steps[T]
    done: int = 0
    made: list[T] = field(default_factory=list)
    """Return value of the steps."""
    error: Exception | None = None
    is_cancelled: bool = False
    ended: bool = False


_waiting = deque[_Job[Any]]()
_current: _Job[Any] | None = None
_main = get_ident()
"""The thread that loads the extension."""


def is_here() -> bool:
    """Return whether this is the main thread; Blender renders in another one while a window is open."""
    return get_ident() == _main


def call[T](function: Callable[[], T]) -> T:
    """Return the result of a function on the main thread; raises its errors, and Cancelled."""

    def steps() -> Steps[T]:
        yield 0
        return function()

    return draw(steps(), 1)


def draw[T](steps: Steps[T], total: int) -> T:
    """Run the steps to their end, with a checkpoint between them; raises what they raise, and Cancelled."""
    if bpy.app.background or is_here():
        return _draw_here(steps, total)
    job = _Job(steps)
    _waiting.append(job)
    try:
        while not job.ended:
            checkpoint(job.done / total)
            time.sleep(LOOK)
    except Cancelled:
        # Not waited for: Blender's main thread may itself be waiting for this one to end.
        job.is_cancelled = True
        raise
    if job.error is not None:
        raise job.error
    if not job.made:
        raise Cancelled
    return job.made[0]


def _draw_here[T](steps: Steps[T], total: int) -> T:
    try:
        while True:
            checkpoint(next(steps) / total)
    except StopIteration as end:
        made: T = end.value
        return made
    finally:
        steps.close()


def _tick() -> float:
    """A timer's turn on the main thread; returns the seconds to the next one."""
    global _current
    tend()
    if _current is None:
        if not _waiting:
            return IDLE
        _current = _waiting.popleft()
    if not has_gpu_context():
        # As after a window was closed: the next redraw makes another one's context the active one.
        for area in redraw.areas():
            area.tag_redraw()
        return IDLE
    job, until = _current, time.monotonic() + SLICE
    try:
        while time.monotonic() < until:
            if job.is_cancelled:
                job.steps.close()
                break
            job.done = next(job.steps)
        else:
            return 0.0
    except StopIteration as end:
        job.made.append(end.value)
    except Exception as error:  # raised again in the thread that waits
        job.error = error
    _current = None
    job.ended = True
    return 0.0


def leave_shader() -> None:
    """Bind one of Blender's shaders before a step that has bound another ends.

    Without it a sweep's last shader drew the first view after it (`tests/scene/test_gpu_sweep.py` renders
    one). Blender identifies the bound shader by its address: if a bound shader was freed and the next one got
    its address, that would not be bound. This reason is likely, not proven.
    """
    gpu.shader.from_builtin("UNIFORM_COLOR").bind()


def has_gpu_context() -> bool:
    """Return whether this thread has an active GPU context."""
    try:
        gpu.types.GPUFrameBuffer()
    except (RuntimeError, SystemError):  # the latter before there is any, in background mode
        return False
    return True


def start() -> None:
    """Begin to look for work, if there is a window."""
    if not bpy.app.background:
        bpy.app.timers.register(_tick, persistent=True)


def stop() -> None:
    """Drop all work, whose GPU data must not outlive the window; waiting threads get Cancelled."""
    global _current
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    left = [*([] if _current is None else [_current]), *_waiting]
    _current = None
    _waiting.clear()
    for job in left:
        job.is_cancelled = True
        job.steps.close()
        job.ended = True
