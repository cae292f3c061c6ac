"""Work on Blender's main thread, in slices, while a render thread waits for the result.

With a window open, a render thread that holds the GPU stops the main thread at its next redraw: the
interface would freeze and never see ESC. So the main thread itself draws, a little between its own events.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu

from ...core.base.job import tend
from ...core.base.progress import Cancelled, checkpoint
from ..base import redraw

type Steps[T] = Generator[int, None, T]
"""Yields how many steps are done, returns what they make. Between two of them another window's GPU context
may become the active one: nothing that belongs to a context (framebuffers) may be kept from one to the
next."""

SLICE = 0.04
"""Seconds of drawing between two looks at the interface's events."""
IDLE = 0.02
"""Seconds between two looks for work: the longest wait of a preview."""


@dataclass
class _Job[T]:
    """One frame's drawing, or what else is done, shared by the two threads."""

    steps: Steps[T]
    done: int = 0
    made: list[T] = field(default_factory=list)
    """Return value of the steps."""
    error: Exception | None = None
    is_cancelled: bool = False
    ended: threading.Event = field(default_factory=threading.Event)


_waiting: queue.SimpleQueue[_Job[Any]] = queue.SimpleQueue()
_current: _Job[Any] | None = None


def call[T](function: Callable[[], T]) -> T:
    """Return the result of a function on the main thread; raises its errors, and Cancelled."""

    def steps() -> Steps[T]:
        yield 0
        return function()

    return draw(steps(), 1)


def draw[T](steps: Steps[T], total: int) -> T:
    """Run the steps to their end, with a checkpoint between them; raises what they raise, and Cancelled."""
    if bpy.app.background or threading.current_thread() is threading.main_thread():
        return _draw_here(steps, total)
    job = _Job(steps)
    _waiting.put(job)
    try:
        while not job.ended.wait(0.05):
            checkpoint(job.done / total)
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
        try:
            _current = _waiting.get_nowait()
        except queue.Empty:
            return IDLE
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
    job.ended.set()
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
    left = [] if _current is None else [_current]
    _current = None
    while not _waiting.empty():
        left.append(_waiting.get_nowait())
    for job in left:
        job.is_cancelled = True
        job.steps.close()
        job.ended.set()
