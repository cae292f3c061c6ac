"""Operators that take clicks on the camera's picture, and find how far away what is there is."""

import math
from collections.abc import Callable

import bpy

from ...core.base.errors import UserError
from ...core.focus.place import Place, PlaceFinder, shown_at
from ...scene.base.remedy_words import WORDS
from ...scene.base.timeline import clip_frame
from ...scene.focus.clicks import places, surface_at
from ...scene.lens.depth_of_field import length_words
from ..base.meanwhile import LOOK
from ..base.operators import Result, sentence
from ..base.work import Work
from .pick_in_view import PicksInView
from .pick_view import XY, Overlay

AT_ONCE = 0.05
"""Seconds in which most places are found: so long a click waits."""
CLOSE = 25.0
"""Pixels, at a resolution scale of 1, from a click within which a picked place is meant."""


class PicksPlaces(PicksInView):
    """A mixin of operators: `took` is called with each found place, `confirm` with Enter."""

    joins = False
    """True if a line connects the last pick to the mouse."""
    tap = False
    """True if the operator ends after one place, found or not."""
    _shifted = False
    """True if Shift was held for the present place."""
    _finder: PlaceFinder | None = None
    _places: list[Place]
    """The picks."""
    _steps: list[list[Place]]
    """The picks before each change."""

    def took(self, context: bpy.types.Context, place: Place, shift: bool) -> Result:
        """Return a place was picked."""
        raise NotImplementedError

    def search(self, at: XY) -> Callable[[], Place]:
        """Return the function that finds the picked place in another process; UserError where nothing can."""
        return surface_at(self._scene, clip_frame(self._scene), *at)

    def confirm(self, context: bpy.types.Context) -> Result:
        """Take what was picked."""
        raise NotImplementedError

    def overlay(self) -> Overlay:
        self._finder = places(self._scene.virtual_aperture, self._context, clip_frame(self._scene))
        return Overlay(self._view, self._scene, joins=self.joins)

    def begun(self, context: bpy.types.Context) -> None:
        self._places, self._steps = self.picked(), []
        self._show_picked()
        self._say("")

    def picked(self) -> list[Place]:
        """Return the initial picks."""
        return []

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            if self._work is not None and not self.tap:
                self._stop(context)
                self._say("")
                return {"RUNNING_MODAL"}
            self._end(context)
            return {"CANCELLED"}
        if self._work is not None:
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

    def take_back(self) -> None:
        if self._work is None and self._steps:
            self._places = self._steps.pop()
            self._show_picked()

    def _look(self, event: bpy.types.Event) -> None:
        """Show the place under the mouse beside it."""
        overlay, finder = self._overlay, self._current_finder()
        at = self._view.place(self._scene, event) if self._view.holds(event) else None
        glance = finder.glance(*at) if finder is not None and at is not None else None
        overlay.mouse = at
        overlay.features = [] if glance is None else glance.places.tolist()
        overlay.text = "" if glance is None else "Click to find the depth here"
        if glance is not None and glance.distance is not None:
            overlay.text = length_words(self._scene.virtual_aperture, glance.distance)
        self._show_picked()
        self._say(overlay.text)

    def _current_finder(self) -> PlaceFinder | None:
        """The finder of the present frame; None without a camera."""
        frame = clip_frame(self._scene)
        if self._finder is None or self._finder.frame != frame:
            try:
                self._finder = places(self._scene.virtual_aperture, self._context, frame)
            except UserError:
                self._finder = None
        return self._finder

    def _click(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if (at := self._pressed_at(event)) is None:
            return {"RUNNING_MODAL"}
        if event.ctrl:
            self._remove(at)
            return {"RUNNING_MODAL"}
        self._overlay.mouse = at
        self._work, self._shifted = Work(self.search(at)), event.shift
        if self._work.ended(AT_ONCE):
            return self._found(context)
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        self._say("Finding the depth here    (ESC: Cancel)", "")
        return {"RUNNING_MODAL"}

    def _wait(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        assert self._work is not None
        if event.type == "TIMER":
            if self._work.ended():
                return self._found(context)
            seen = self._work.shown
            if seen and self._overlay.mask is None:
                self._overlay.light_up(seen[-1])
            what = "subject in all frames" if seen else "depth here"
            self._overlay.text = f"Finding the {what} {self._work.stage}"
            self._say(f"{self._overlay.text}    (ESC: Cancel)", "")
        return {"PASS_THROUGH"} if event.type in {"TIMER", "MOUSEMOVE"} else {"RUNNING_MODAL"}

    def _found(self, context: bpy.types.Context) -> Result:
        """Handle a found place, or the reason why there is none."""
        work = self._work
        assert work is not None
        self._stop(context)
        # The frame's depth is known now.
        self._finder = None
        if isinstance(work.error, UserError) and not self.tap:
            text = work.error.worded(WORDS)
            self._overlay.text = "The depth here is unknown"
            self._say(sentence(text))
            return {"RUNNING_MODAL"}
        return self.took(context, work.result(), self._shifted)

    def _keep(self, place: Place) -> Result:
        """Add a place to those that are picked, and go on."""
        self._steps.append(self._places)
        self._places = [*self._places, place]
        self._show_picked()
        self._say("")
        return {"RUNNING_MODAL"}

    def _remove(self, at: XY) -> None:
        """Forget the picked place at a place of the picture."""
        scale = bpy.context.preferences.system.ui_scale
        shown = [(n, xy) for n, place in enumerate(self._places) if (xy := self._shown_at(place)) is not None]
        (here,) = self._view.pixels(self._scene, [at])
        pixels = self._view.pixels(self._scene, [xy for _, xy in shown])
        away = [(math.dist(here, each), n) for (n, _), each in zip(shown, pixels, strict=True)]
        if not away or min(away)[0] > CLOSE * scale:
            self._say("There is no picked place here")
            return
        nearest = min(away)[1]
        self._steps.append(self._places)
        self._places = [*self._places[:nearest], *self._places[nearest + 1 :]]
        self._show_picked()
        self._say("")

    def _shown_at(self, place: Place) -> XY | None:
        return shown_at(place, self._context.reconstruction, clip_frame(self._scene))

    def _show_picked(self) -> None:
        self._overlay.picked = [xy for each in self._places if (xy := self._shown_at(each)) is not None]
        self._view.area.tag_redraw()
