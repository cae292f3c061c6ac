"""The eyedropper of the focus: a click on the camera's picture puts what is there in focus."""

from __future__ import annotations

from functools import partial

import bpy

from ..core.base.errors import UserError
from ..core.focus.place import Glance, Place, PlaceFinder, shown_at
from ..core.frame.clip_context import ClipContext
from ..scene import aperture_cloud, focus_marks
from ..scene.depth_of_field import length_words
from ..scene.remedy_words import WORDS
from ..scene.shot import shot_of
from .focus import focus_on
from .operators import Result, has_solve, is_met, may_change, reported
from .pick_view import XY, CameraView, Overlay
from .work import Work

AT_ONCE = 0.05
"""Seconds in which most places are found: so long a click waits."""
LOOK = 0.05
"""Seconds between two looks at one that takes longer."""
CLOSE = 25.0
"""Pixels, at a resolution scale of 1, from a click within which a picked place is meant."""
KEYS = "Click: Set    Shift Click: Add Place    Ctrl Click: Remove Place    Enter: Confirm    ESC: Cancel"


class VIRTUAL_APERTURE_OT_pick_focus(bpy.types.Operator):  # noqa: N801
    """Click what should be in focus at the current frame, in the camera view. Shift adds places, Ctrl
    removes them"""

    bl_idname = "virtual_aperture.pick_focus"
    bl_label = "Pick Focus"
    # Not REGISTER: there is nothing to redo without the mouse.
    bl_options = {"UNDO"}  # noqa: RUF012

    add: bpy.props.BoolProperty(
        name="Add Mark",
        description="Add a second focus mark at the current frame instead of replacing the first, so that"
        " focus is pulled to it",
        options={"SKIP_SAVE"},
    )
    x: bpy.props.FloatProperty(
        name="X",
        description="Position from the left, as a fraction of the image width",
        min=0,
        max=1,
        default=0.5,
        options={"SKIP_SAVE"},
    )
    y: bpy.props.FloatProperty(
        name="Y",
        description="Position from the top, as a fraction of the image height",
        min=0,
        max=1,
        default=0.5,
        options={"SKIP_SAVE"},
    )

    _running = False
    """Of the class: one is under way."""
    _timer: bpy.types.Timer | None = None
    _finding: Work[Place] | None = None
    """A place that is looked for: where its depth must be found first, that takes seconds."""
    _keeps_on = False
    """More places may be picked after it."""
    _finder: PlaceFinder | None = None

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        is_idle = not VIRTUAL_APERTURE_OT_pick_focus._running
        message = "Focus is being picked; click in the camera view"
        return is_met(cls, is_idle, message) and may_change(cls, context) and has_solve(cls, context)

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        scene = context.scene
        place = shot_of(scene).context.places(scene.frame_current).find(self.x, self.y)
        self.report({"INFO"}, focus_on(scene.virtual_aperture, scene.frame_current, [place], self.add))
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        return self.execute(context) if bpy.app.background else self._begin(context)

    @reported
    def _begin(self, context: bpy.types.Context) -> Result:
        scene, settings = context.scene, context.scene.virtual_aperture
        if settings.points.mode == "EDIT":
            # There only the mesh can be undone.
            bpy.ops.object.mode_set(mode="OBJECT")
        self._context: ClipContext = shot_of(scene).context
        self._finder = self._context.places(scene.frame_current)
        self._view, self._scene = CameraView.of(context), scene
        self._overlay = Overlay(self._view, scene)
        mark = self._mark()
        self._places = list(focus_marks.places_of(mark)) if mark is not None and len(mark.places) else []
        self._had_places = bool(self._places)
        self._overlay.begin()
        self._show_picked()
        self._say("")
        context.window.cursor_modal_set("EYEDROPPER")
        context.window_manager.modal_handler_add(self)
        VIRTUAL_APERTURE_OT_pick_focus._running = True
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        try:
            return self._modal(context, event)
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
            return self._confirm(context)
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
        return length_words(self._scene.unit_settings, glance.distance)

    def _current_finder(self) -> PlaceFinder | None:
        """The finder of the frame that is shown now; None where it has no camera of its own."""
        frame = self._scene.frame_current
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
            self._say(f"Frame {self._scene.frame_current} was not solved; pick in another frame")
            return {"RUNNING_MODAL"}
        self._overlay.mouse = at
        self._finding, self._keeps_on = Work(partial(finder.find, *at)), event.shift
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
            self._overlay.text = f"Finding the depth here {self._finding.stage}"
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
        place = finding.result()
        if self._keeps_on:
            self._places.append(place)
            self._show_picked()
            self._say("")
            return {"RUNNING_MODAL"}
        self._places = [place]
        return self._confirm(context)

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

    def _confirm(self, context: bpy.types.Context) -> Result:
        """Write what was picked."""
        self._end(context)
        settings, frame = self._scene.virtual_aperture, self._scene.frame_current
        if self._places:
            self.report({"INFO"}, focus_on(settings, frame, self._places, self.add))
            return {"FINISHED"}
        mark = self._mark()
        if mark is None or not self._had_places:
            return {"CANCELLED"}
        number = next(n for n, each in enumerate(settings.marks.items) if each == mark)
        self.report({"INFO"}, f"Removed the focus mark at frame {mark.frame}")
        focus_marks.remove(settings, number)
        aperture_cloud.update(settings)
        return {"FINISHED"}

    def _mark(self) -> bpy.types.PropertyGroup | None:
        """The mark that is picked again, if it is not a new one."""
        settings = self._scene.virtual_aperture
        here = focus_marks.at_frame(settings, self._scene.frame_current)
        if here is None and not self.add and len(settings.marks.items) == 1:
            return settings.marks.items[0]
        return here

    def _shown_at(self, place: Place) -> XY | None:
        return shown_at(place, self._context.reconstruction, self._scene.frame_current)

    def _show_picked(self) -> None:
        self._overlay.picked = [xy for each in self._places if (xy := self._shown_at(each)) is not None]
        self._view.area.tag_redraw()

    def _say(self, text: str, keys: str = KEYS) -> None:
        """A line in the header of the view, with what keys do."""
        self._view.area.header_text_set("    ".join(each for each in (text, keys) if each))
        self._view.area.tag_redraw()

    def _stop_finding(self, context: bpy.types.Context) -> None:
        if self._finding is not None:
            self._finding.cancel()
            self._finding = None
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None

    def _end(self, context: bpy.types.Context) -> None:
        VIRTUAL_APERTURE_OT_pick_focus._running = False
        self._stop_finding(context)
        self._overlay.end()
        self._view.area.header_text_set(None)
        if context.window is not None:
            context.window.cursor_modal_restore()


CLASSES = (VIRTUAL_APERTURE_OT_pick_focus,)
