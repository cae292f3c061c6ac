"""Work in a thread, so that the window stays alive, and operators that wait for one piece of it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import bpy

from ..core.base.errors import UserError
from ..core.base.progress import Cancelled, reporting
from ..render.viewport import PREVIEW
from ..scene.remedy_words import WORDS
from .operators import Result, reported

LOOK = 0.05
"""Seconds between two looks at the work."""


class Work[T]:
    """A function that is called in a thread, while nothing else works with the clip."""

    def __init__(self, function: Callable[[], T], after: Work[Any] | None = None) -> None:
        """It begins once the work `after` has ended."""
        self.stage = ""
        self.error: BaseException | None = None
        self._value: list[T] = []
        self._cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(function, after), daemon=True)
        self._thread.start()

    def ended(self, wait: float = 0.0) -> bool:
        """Whether it has ended, after so many seconds at most."""
        self._thread.join(wait)
        return not self._thread.is_alive()

    def result(self) -> T:
        """What the function returned, once it has ended; raises what it raised."""
        if self.error is not None:
            raise self.error
        return self._value[0]

    def cancel(self) -> None:
        """Do it no more: it ends at its next checkpoint."""
        self._cancelled.set()

    def _run(self, function: Callable[[], T], after: Work[Any] | None) -> None:
        try:
            if after is not None:
                after._thread.join()
            # Both would take all processors, and the same memory.
            with PREVIEW.paused(), reporting(self._on_progress):
                self._on_progress("", 0.0)
                self._value.append(function())
        except BaseException as error:  # told where it is waited for
            self.error = error

    def _on_progress(self, stage: str, share: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled
        self.stage = f"{100 * share:.0f} %" if share else stage


class WorksMeanwhile:
    """An operator that computes something in a thread, with its progress in the status bar and ESC to cancel,
    and then brings it into the scene in one step of undo: until then nothing of the scene is touched."""

    doing = ""
    """What it does, for the status bar."""
    _timer: bpy.types.Timer | None = None
    _work: Work[Any] | None = None
    _under_way = False
    """Of the mixin: there are not two at once."""

    def work(self, context: bpy.types.Context) -> Callable[[], Any]:
        """What is to be computed; UserError where that cannot be."""
        raise NotImplementedError

    def finish(self, scene: bpy.types.Scene, found: Any) -> str:
        """Bring it into the scene; what was done, in a line. UserError where that cannot be."""
        raise NotImplementedError

    @reported
    def execute(self: Any, context: bpy.types.Context) -> Result:
        found = self.work(context)()
        self.report({"INFO"}, self.finish(context.scene, found))
        return {"FINISHED"}

    def invoke(self: Any, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        result: Result = self.execute(context) if bpy.app.background else self._begin(context)
        return result

    @reported
    def _begin(self: Any, context: bpy.types.Context) -> Result:
        # The user may go to another scene meanwhile.
        self._scene = context.scene.name
        self._work = Work(self.work(context))
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        WorksMeanwhile._under_way = True
        return {"RUNNING_MODAL"}

    def modal(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC" and event.value == "PRESS":
            self._end(context)
            self.report({"WARNING"}, f"{self.bl_label} cancelled; nothing was changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if not self._work.ended():
            context.workspace.status_text_set(f"{self.doing} {self._work.stage}    (ESC cancels)")
            return {"RUNNING_MODAL"}
        self._end(context)
        try:
            scene = bpy.data.scenes.get(self._scene)
            if scene is None:
                raise UserError(f"the scene {self._scene!r} no longer exists")
            self.report({"INFO"}, self.finish(scene, self._work.result()))
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile."""
        self._end(context)

    def _end(self, context: bpy.types.Context) -> None:
        WorksMeanwhile._under_way = False
        if self._work is not None:
            self._work.cancel()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        if context.workspace is not None:
            context.workspace.status_text_set(None)
