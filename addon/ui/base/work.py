"""Work in another process, so that the window stays alive, and operators that wait for a piece of it."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...core.base.time_left import TimeLeft
from ...render.processes.clip_process import CLIP, ClipProcess
from ...render.viewport.viewport import PREVIEW
from .meanwhile import Meanwhile
from .operators import Acts, Result
from .text import left_words

SOON = 0.005
"""Seconds between two looks at work that is waited for."""


class Work[T]:
    """A function that is called in the preview's process, which does nothing else meanwhile."""

    def __init__(self, function: Callable[[], T], own: ClipProcess | None = None) -> None:
        """It begins once the work before has ended.

        Args:
            function: The function, one for `parcel.pack`.
            own: Another process, which leaves the preview running.

        Raises:
            UserError: The process cannot be started.
        """
        self._clock = TimeLeft(time.monotonic())
        self._pause = ExitStack()
        if own is None:
            # Both would take all processors, and the same memory.
            self._pause.enter_context(PREVIEW.paused())
        self._process = own or CLIP
        try:
            self._call = self._process.call(function)
        except BaseException:
            self._pause.close()
            raise

    @property
    def stage(self) -> str:
        """How far it is, in a few words."""
        left = left_words(self._clock.at(time.monotonic(), self._call.share))
        done = f"{100 * self._call.share:.0f}%" if self._call.share else self._call.stage
        return ", ".join(filter(None, (done, left[:1].lower() + left[1:])))

    @property
    def shown(self) -> list[Any]:
        """All that the function has shown so far (`calls.show`)."""
        return self._call.shown

    @property
    def error(self) -> Exception | None:
        """The function's error."""
        return self._call.error

    def ended(self, wait: float = 0.0) -> bool:
        """Return whether it has ended, after so many seconds at most."""
        until = time.monotonic() + wait
        while True:
            self._process.poll()
            if self._call.ended:
                self._pause.close()
            if self._call.ended or time.monotonic() >= until:
                return self._call.ended
            time.sleep(SOON)

    def result(self) -> T:
        """Return the function's result after its end, or raise its error."""
        return self._call.result()

    def cancel(self) -> None:
        """Do it no more: it ends at its next checkpoint."""
        self._call.cancel()
        self._pause.close()


class WorksMeanwhile(Meanwhile, Acts):
    """An operator with a computation in another process, progress in the status bar and ESC to cancel.

    The result is brought into the scene in one undo step; until then the scene is not touched.
    """

    doing = ""
    """Words for the status bar."""
    _work: Work[Any] | None = None
    _under_way = False
    """Class attribute of the mixin: only one works at a time."""

    def work(self, context: bpy.types.Context) -> Callable[[], Any]:
        """Return the computation, one for `parcel.pack`; UserError if there is none."""
        raise NotImplementedError

    def finish(self, scene: bpy.types.Scene, found: Any) -> str:
        """Bring the result into the scene; returns a line about it, or raises UserError."""
        raise NotImplementedError

    # Without a window it is computed in this process.
    execute = Acts.execute

    def act(self, context: bpy.types.Context) -> str:
        return self.finish(context.scene, self.work(context)())

    def begin(self, context: bpy.types.Context) -> None:
        # The user may go to another scene meanwhile.
        self._scene = context.scene.name
        self._work = Work(self.work(context))
        WorksMeanwhile._under_way = True

    def look(self) -> bool:
        assert self._work is not None
        return self._work.ended()

    def show(self, context: bpy.types.Context) -> None:
        assert self._work is not None
        context.workspace.status_text_set(f"{self.doing} {self._work.stage}    (ESC cancels)")

    def end(self) -> None:
        WorksMeanwhile._under_way = False
        if self._work is not None:
            self._work.cancel()

    def stopped(self: Any) -> str:
        return f"{self.bl_label} cancelled; nothing was changed"

    def conclude(self: Any) -> Result:
        scene = bpy.data.scenes.get(self._scene)
        if scene is None:
            raise UserError(f"the scene {self._scene!r} no longer exists")
        self.report({"INFO"}, self.finish(scene, self._work.result()))
        return {"FINISHED"}
