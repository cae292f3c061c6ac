"""Operators that work while the window stays alive, and ask before they replace something."""

import time
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...scene.base import redraw
from ...scene.base.remedy_words import WORDS
from .operators import Named, Result, asked, reported

LOOK = 0.05
"""Seconds between two looks at the work."""


class Meanwhile(Named):
    """A mixin of operators: `begin`, then `look` until it returns True, then `end` and `conclude`.

    In a window a timer looks; without one the operator waits.
    """

    sure_by = "sure"
    """Name of the property with which nothing is asked."""
    _timer: bpy.types.Timer | None = None
    _later: dict[str, object] | None = None
    """Properties of the call that `execute` is to make in the window, after a question or a file browser."""

    def question(self, context: bpy.types.Context) -> dict[str, str]:
        """Return the texts of a question before the work, as of `asked`; none where nothing is asked."""
        return {}

    def begin(self, context: bpy.types.Context) -> None:
        """Begin the work, or raise UserError."""
        raise NotImplementedError

    def look(self) -> bool:
        """Look at the work; returns whether it is done, or raises UserError."""
        raise NotImplementedError

    def show(self, context: bpy.types.Context) -> None:
        """Show how far it is, in a window."""

    def end(self) -> None:
        """End the work; harmless after its end."""
        raise NotImplementedError

    def conclude(self) -> Result:
        """Bring the result to the user, or raise UserError."""
        raise NotImplementedError

    def give_up(self) -> None:
        """Restore what `begin` has changed, after ESC or an error."""

    def stopped(self) -> str:
        """Return a line for the user whose ESC ends the work; empty where ESC does not."""
        return ""

    def invoke(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if bpy.app.background:
            result: Result = self.execute(context)
            return result
        return reported(lambda own, context: own._open(context, event))(self, context)

    def _open(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        """Ask the question, or begin."""
        if words := self.question(context):
            self._later = {self.sure_by: True}
            return asked(self, context, event, **words)
        self.begin(context)
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        redraw.panels()
        return {"RUNNING_MODAL"}

    @reported
    def execute(self: Any, context: bpy.types.Context) -> Result:
        if self._later is not None:
            self.once_more(**self._later)
            return {"CANCELLED"}
        self.begin(context)
        try:
            while not self.look():
                time.sleep(LOOK)
        except BaseException:
            self.give_up()
            raise
        finally:
            self.end()
        result: Result = self.conclude()
        return result

    def modal(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC" and self.stopped():
            self._close(context)
            self.give_up()
            self.report({"WARNING"}, self.stopped())
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            if not self.look():
                self.show(context)
                return {"PASS_THROUGH"}
            self._close(context)
            result: Result = self.conclude()
            return result
        except BaseException as error:
            # Else a process would go on, and its folder stay locked, without anybody to end it.
            self._close(context)
            self.give_up()
            if not isinstance(error, UserError):
                raise
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}

    def cancel(self, _context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile, or the question is answered by no."""
        if self._timer is not None:
            self.end()

    def _close(self, context: bpy.types.Context) -> None:
        self.end()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        context.workspace.status_text_set(None)
        redraw.panels()
