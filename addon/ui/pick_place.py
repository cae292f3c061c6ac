"""Operators that take clicks on the camera's picture, and find how far away what is there is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import bpy

from ..core.base.arrays import Mask
from ..core.base.errors import UserError
from ..core.focus.place import Glance, Place, PlaceFinder, shown_at
from ..core.frame.clip_context import ClipContext
from ..scene.depth_of_field import length_words
from ..scene.remedy_words import WORDS
from ..scene.shot import shot_of
from ..scene.timeline import clip_frame
from .operators import Result, has_solve, is_met, may_change, reported
from .pick_view import XY, CameraView, Overlay
from .work import Work

AT_ONCE = 0.05
"""Seconds in which most places are found: so long a click waits."""
LOOK = 0.05
"""Seconds between two looks at one that takes longer."""
CLOSE = 25.0
"""Pixels, at a resolution scale of 1, from a click within which a picked place is meant."""


class PicksPlaces:
    """A mixin of operators: `took` is called with each place that was found, `confirm` when Enter is
    pressed."""

    hint = ""
    """What mouse and keys do, for the header of the view."""
    joins = False
    """Whether a line goes from what was picked to the mouse."""
    _running = False
    """Of the mixin: one is under way."""
    _timer: bpy.types.Timer | None = None
    _finding: Work[Place] | None = None
    """A place that is looked for: where its depth must be found first, that takes seconds."""
    _seen: list[Mask]
    """(h, w) the subject that the place is on, once it is seen."""
    _shifted = False
    """Whether Shift was held for it."""
    _finder: PlaceFinder | None = None
    _places: list[Place]
    """What was picked."""

    def took(self, context: bpy.types.Context, place: Place, shift: bool) -> Result:
        """A place was picked."""
        raise NotImplementedError

    def search(self, finder: PlaceFinder, at: XY) -> Callable[[], Place]:
        """Return what finds the place that is picked by a click, in a thread; UserError where nothing can."""
        return partial(finder.find, *at)

    def confirm(self, context: bpy.types.Context) -> Result:
        """Take what was picked."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        message = "A place is being picked; click in the camera view"
        is_idle = is_met(cls, not PicksPlaces._running, message)
        return is_idle and may_change(cls, context) and has_solve(cls, context)

    def invoke(self: Any, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        result: Result = (
            self.execute(context) if bpy.app.background else reported(type(self).begin)(self, context)
        )
        return result

    def begin(self: Any, context: bpy.types.Context) -> Result:
        """Take clicks from now on; UserError where that cannot be."""
        scene, settings = context.scene, context.scene.virtual_aperture
        if settings.points.mode == "EDIT":
            # There only the mesh can be undone.
            bpy.ops.object.mode_set(mode="OBJECT")
        self._context: ClipContext = shot_of(scene).context
        self._finder = self._context.places(clip_frame(scene))
        self._view, self._scene = CameraView.of(context), scene
        self._overlay = Overlay(self._view, scene, joins=self.joins)
        self._places = self.picked()
        self._overlay.begin()
        self._show_picked()
        self._say("")
        context.window.cursor_modal_set("EYEDROPPER")
        context.window_manager.modal_handler_add(self)
        PicksPlaces._running = True
        return {"RUNNING_MODAL"}

    def picked(self) -> list[Place]:
        """What is picked to begin with."""
        return []

    def modal(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        try:
            result: Result = self._modal(context, event)
            return result
        except UserError as error:
            self._end(context)
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}
        except Exception:
            # Else the cursor would stay, and the next one be refused.
            self._end(context)
            raise

    def _modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            if self._finding is not None:
                self._stop_finding(context)
                self._say("")
                return {"RUNNING_MODAL"}
            self._end(context)
            return {"CANCELLED"}
        if self._finding is not None:
            return self._wait(context, event)
        if event.type == "MOUSEMOVE":
            self._look(event)
            return {"PASS_THROUGH"}
        if event.type in {"RET", "NUMPAD_ENTER"} and event.value == "PRESS":
            return self.confirm(context)
        if event.type == "LEFTMOUSE" and event.value == "PRESS" and self._view.holds(event):
            return self._click(context, event)
        # The view may be moved, and another frame shown.
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile."""
        self._end(context)

    def _look(self, event: bpy.types.Event) -> None:
        """What is under the mouse, shown beside it."""
        overlay, finder = self._overlay, self._current_finder()
        at = self._view.place(self._scene, event) if self._view.holds(event) else None
        glance = finder.glance(*at) if finder is not None and at is not None else None
        overlay.mouse = at
        overlay.features = [] if glance is None else glance.places.tolist()
        overlay.text = "" if glance is None else self._glance_text(glance)
        self._show_picked()
        self._say(overlay.text)

    def _glance_text(self, glance: Glance) -> str:
        if glance.distance is None:
            return "Click to find the depth here"
        return length_words(self._scene.virtual_aperture, glance.distance)

    def _current_finder(self) -> PlaceFinder | None:
        """The finder of the frame that is shown now; None where it has no camera of its own."""
        frame = clip_frame(self._scene)
        if self._finder is None or self._finder.frame != frame:
            try:
                self._finder = self._context.places(frame)
            except UserError:
                self._finder = None
        return self._finder

    def _click(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        at = self._view.place(self._scene, event)
        if not self._view.is_through_camera() or at is None:
            self._say("Click in the camera view (Numpad 0 looks through the camera)")
            return {"RUNNING_MODAL"}
        if event.ctrl:
            self._remove(at)
            return {"RUNNING_MODAL"}
        finder = self._current_finder()
        if finder is None:
            self._say(f"Frame {clip_frame(self._scene)} was not solved; pick in another frame")
            return {"RUNNING_MODAL"}
        self._overlay.mouse = at
        self._seen = []
        self._finding, self._shifted = Work(self.search(finder, at)), event.shift
        if self._finding.ended(AT_ONCE):
            return self._found(context)
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        self._say("Finding the depth here    (ESC: Cancel)", "")
        return {"RUNNING_MODAL"}

    def _wait(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        assert self._finding is not None
        if event.type == "TIMER":
            if self._finding.ended():
                return self._found(context)
            if self._seen and self._overlay.mask is None:
                self._overlay.light_up(self._seen[-1])
            what = "subject in all frames" if self._seen else "depth here"
            self._overlay.text = f"Finding the {what} {self._finding.stage}"
            self._say(f"{self._overlay.text}    (ESC: Cancel)", "")
        return {"PASS_THROUGH"} if event.type in {"TIMER", "MOUSEMOVE"} else {"RUNNING_MODAL"}

    def _found(self, context: bpy.types.Context) -> Result:
        """Take in what was found, or say why nothing was."""
        finding = self._finding
        self._stop_finding(context)
        assert finding is not None
        if isinstance(finding.error, UserError):
            text = finding.error.worded(WORDS)
            self._overlay.text = "The depth here is unknown"
            self._say(text[0].upper() + text[1:])
            return {"RUNNING_MODAL"}
        return self.took(context, finding.result(), self._shifted)

    def _keep(self, place: Place) -> Result:
        """Add a place to those that are picked, and go on."""
        self._places.append(place)
        self._show_picked()
        self._say("")
        return {"RUNNING_MODAL"}

    def _remove(self, at: XY) -> None:
        """Forget the picked place at a place of the picture."""
        scale = bpy.context.preferences.system.ui_scale
        shown = [(n, xy) for n, place in enumerate(self._places) if (xy := self._shown_at(place)) is not None]
        (here,) = self._view.pixels(self._scene, [at])
        away = [
            (float(((px - here[0]) ** 2 + (py - here[1]) ** 2) ** 0.5), n)
            for (n, _), (px, py) in zip(
                shown, self._view.pixels(self._scene, [xy for _, xy in shown]), strict=True
            )
        ]
        if not away or min(away)[0] > CLOSE * scale:
            self._say("There is no picked place here")
            return
        del self._places[min(away)[1]]
        self._show_picked()
        self._say("")

    def _shown_at(self, place: Place) -> XY | None:
        return shown_at(place, self._context.reconstruction, clip_frame(self._scene))

    def _show_picked(self) -> None:
        self._overlay.picked = [xy for each in self._places if (xy := self._shown_at(each)) is not None]
        self._view.area.tag_redraw()

    def _say(self, text: str, keys: str | None = None) -> None:
        """A line in the header of the view, with what keys do."""
        shown = (text, self.hint if keys is None else keys)
        self._view.area.header_text_set("    ".join(filter(None, shown)))
        self._view.area.tag_redraw()

    def _stop_finding(self, context: bpy.types.Context) -> None:
        if self._finding is not None:
            self._finding.cancel()
            self._finding = None
            self._overlay.light_up(None)
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def _end(self, context: bpy.types.Context) -> None:
        PicksPlaces._running = False
        self._stop_finding(context)
        self._overlay.end()
        self._view.area.header_text_set(None)
        if context.window is not None:
            context.window.cursor_modal_restore()
