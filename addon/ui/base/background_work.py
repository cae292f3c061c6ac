"""Operators that wait for one piece of work in another process."""

from collections.abc import Callable
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...scene.base.remedy_words import WORDS
from .operators import Acts, Result, reported
from .work import LOOK, Work


class WorksMeanwhile(Acts):
    """An operator with a computation in another process, progress in the status bar and ESC to cancel.

    The result is brought into the scene in one undo step; until then the scene is not touched.
    """

    doing = ""
    """Words for the status bar."""
    _timer: bpy.types.Timer | None = None
    _work: Work[Any] | None = None
    _under_way = False
    """Class attribute of the mixin: only one works at a time."""

    def work(self, context: bpy.types.Context) -> Callable[[], Any]:
        """Return the computation, one for `parcel.pack`; UserError if there is none."""
        raise NotImplementedError

    def finish(self, scene: bpy.types.Scene, found: Any) -> str:
        """Bring the result into the scene; returns a line about it, or raises UserError."""
        raise NotImplementedError

    def act(self, context: bpy.types.Context) -> str:
        return self.finish(context.scene, self.work(context)())

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
