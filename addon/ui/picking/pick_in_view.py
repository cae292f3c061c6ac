"""Operators that take the mouse over the camera's picture, until what is meant is picked."""

from typing import Any

import bpy

from ...core.base.errors import UserError
from ...core.focus.picking import unsolved
from ...core.frame.clip_context import ClipContext
from ...render.processes.clip_process import CLIP
from ...scene.base.remedy_words import WORDS
from ...scene.base.timeline import clip_frame
from ...scene.sources.shot import Shot, shot_of
from ..base.operators import Acts, Result, has_solve, may_change, polls, reported, requires, sentence
from ..base.work import Work
from .pick_view import XY, CameraView, Overlay

EXAMPLE = "0.44,0.26 0.45,0.5"
STROKE = bpy.props.StringProperty(
    name="Places",
    description=f"Corners of the stroke as fractions of the image from the top left, such as {EXAMPLE}",
    options={"SKIP_SAVE"},
)
"""Property of operators that draw a stroke."""


class PicksInView(Acts):
    """A mixin of modal operators that draw an overlay over the camera view meanwhile."""

    # Not REGISTER: there is nothing to redo without the mouse.
    bl_options = {"UNDO"}  # noqa: RUF012

    hint = ""
    """The mouse and the keys, for the header of the view."""
    doing = "Click"
    """Verb for the mouse in the camera view."""
    cursor = "EYEDROPPER"
    _running = False
    """Class attribute of the mixin: only one works at a time."""
    _timer: bpy.types.Timer | None = None
    _work: Work[Any] | None = None
    """The present computation: depth that must be found first takes seconds."""
    _shot: Shot
    _context: ClipContext
    _scene: bpy.types.Scene
    _view: CameraView
    _overlay: Overlay

    def overlay(self) -> Overlay:
        """Return the drawing over the view."""
        raise NotImplementedError

    def begun(self, context: bpy.types.Context) -> None:
        """Draw the overlay from now on."""
        raise NotImplementedError

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        """Handle the mouse and the keys; a UserError ends the operator."""
        raise NotImplementedError

    def take_back(self) -> None:
        """Undo the last step of the operator, if it has one."""
        raise NotImplementedError

    poll = polls(
        requires(lambda _: not PicksInView._running, "Something is being picked in the camera view"),
        may_change, has_solve,
    )  # fmt: skip

    def invoke(self: Any, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        result: Result = self.execute(context) if bpy.app.background else self._begin(context)
        return result

    @reported
    def _begin(self: Any, context: bpy.types.Context) -> Result:
        scene, settings = context.scene, context.scene.virtual_aperture
        if settings.points.mode == "EDIT":
            # There only the mesh can be undone.
            bpy.ops.object.mode_set(mode="OBJECT")
        self._shot = shot_of(scene)
        # Until the first click it is there.
        CLIP.begin()
        self._context = self._shot.context
        self._view, self._scene = CameraView.of(context), scene
        self._overlay = self.overlay()
        self._overlay.begin()
        self.begun(context)
        context.window.cursor_modal_set(self.cursor)
        context.window_manager.modal_handler_add(self)
        PicksInView._running = True
        return {"RUNNING_MODAL"}

    def modal(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        try:
            if event.type == "Z" and (event.ctrl or event.oskey):
                # An undo of Blender's own would pull the scene from under the operator.
                if event.value == "PRESS" and not event.shift:
                    self.take_back()
                return {"RUNNING_MODAL"}
            result: Result = self.on_event(context, event)
            return result
        except UserError as error:
            self._end(context)
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}
        except Exception:
            # Else the cursor would stay, and the next one be refused.
            self._end(context)
            raise

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile."""
        self._end(context)

    def _say(self, text: str, keys: str | None = None) -> None:
        """Show a line in the header of the view, with the keys."""
        shown = (text, self.hint if keys is None else keys)
        self._view.area.header_text_set("    ".join(filter(None, shown)))
        self._view.area.tag_redraw()

    def _pressed_at(self, event: bpy.types.Event) -> XY | None:
        """Place of the picture under the mouse; None, with the reason in the header, if it cannot be used."""
        at, frame = self._view.place(self._scene, event), clip_frame(self._scene)
        if not self._view.is_through_camera() or at is None:
            self._say(f"{self.doing} in the camera view (Numpad 0 looks through the camera)")
            return None
        if frame not in self._context.reconstruction.frames:
            self._say(sentence(unsolved(self._context.reconstruction, frame)))
            return None
        return at

    def _hover(self, event: bpy.types.Event) -> None:
        """Show the mouse over the picture; beside the view there is none."""
        self._overlay.mouse = self._view.place(self._scene, event) if self._view.holds(event) else None
        self._view.area.tag_redraw()

    def _stop(self, context: bpy.types.Context) -> None:
        """Find no more."""
        if self._work is not None:
            self._work.cancel()
            self._work, self._overlay.text = None, ""
            self._overlay.light_up(None)
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def _end(self, context: bpy.types.Context) -> None:
        PicksInView._running = False
        self._stop(context)
        self._overlay.end()
        self._view.area.header_text_set(None)
        if context.window is not None:
            context.window.cursor_modal_restore()
