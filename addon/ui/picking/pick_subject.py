"""Marking a subject by strokes over the camera's picture: the whole of it lights up."""

from functools import partial

import bpy

from ...core.base.arrays import Mask
from ...core.base.calls import show
from ...core.base.errors import UserError
from ...core.focus.picking import unsolved
from ...core.subjects.clip_subjects import united
from ...core.subjects.strokes import MarkedSubject, Stroke, down, nearest_to, places_of, with_stroke
from ...scene.base import redraw
from ...scene.base.timeline import clip_frame
from ...scene.sources import subjects
from ...scene.sources.shot import Shot, reconstruction_of
from ..base.meanwhile import LOOK
from ..base.operators import Result
from ..base.work import Work
from .pick_in_view import EXAMPLE, STROKE, PicksInView
from .pick_view import Overlay

NOTHING = "There is nothing to take away from yet"
CORNERS = 5
"""Corners of the stroke that marks a found person."""


def light_up(shot: Shot, marked: MarkedSubject, frame: int) -> Mask:
    """Return a marked subject (h, w) in a frame, and show it (`calls.show`) while it becomes better known."""
    mask: Mask | None = None
    for mask in shot.context.parts.subjects.carried(marked).masks(frame):
        show(mask)
    assert mask is not None
    return mask


def people_of(shot: Shot, frame: int) -> dict[str, Mask]:
    """Return the people (h, w) whom nobody has marked, by name, in a frame in which a stroke may follow."""
    return shot.context.prepare_subject(frame)


def marked_person(stroke: Stroke, frame: int, people: dict[str, Mask]) -> tuple[Stroke, ...]:
    """Return strokes that mark the person whom a stroke is to correct; none where it is beside them all.

    Args:
        stroke: The stroke.
        frame: The frame in which the people are known.
        people: (h, w) each of them, by name.
    """
    person = nearest_to(stroke, people) if stroke.frame == frame else None
    return () if person is None else (Stroke(frame, down(people[person], CORNERS)),)


class VIRTUAL_APERTURE_OT_pick_subject(PicksInView, bpy.types.Operator):  # noqa: N801
    """Draw a stroke over a moving subject, or click it.

    All of it lights up, and is marked in all frames. Shift extends it, Ctrl takes parts away
    """

    new: bpy.props.BoolProperty(
        name="New Subject",
        description="Mark another subject instead of the active one",
        options={"SKIP_SAVE"},
    )
    places: STROKE
    extend: bpy.props.BoolProperty(
        name="Extend",
        description="Keep the strokes the subject has in the current frame",
        options={"SKIP_SAVE"},
    )
    take_away: bpy.props.BoolProperty(
        name="Take Away",
        description="Remove what is under the stroke from the subject",
        options={"SKIP_SAVE"},
    )

    hint = (
        "Drag: Mark    Shift Drag: Extend    Ctrl Drag: Take Away    Enter, Right Click: Confirm"
        "    ESC: Undo Last Stroke"
    )
    doing, cursor = "Draw", "PAINT_BRUSH"
    _people: Work[dict[str, Mask]] | None = None
    """The search for people whom nobody has marked; None where a subject is looked for."""
    _masks: dict[str, Mask]
    """(h, w) these people, once they are known."""

    def act(self, context: bpy.types.Context) -> str:
        scene, settings = context.scene, context.scene.virtual_aperture
        frame = clip_frame(scene)
        try:
            places = places_of(self.places.split())
        except ValueError:
            places = ()
        if not places:
            raise UserError(f"the stroke {self.places!r} is not valid; write places such as {EXAMPLE}")
        if frame not in (solved := reconstruction_of(settings)).frames:
            raise UserError(unsolved(solved, frame))
        name, strokes = self._subject(settings)
        made = with_stroke(strokes, Stroke(frame, places, not self.take_away), self.extend)
        if not any(stroke.adds for stroke in made):
            raise UserError("there is nothing to take away from yet; mark the subject first")
        subjects.set_strokes(settings, name, made)
        redraw.panels()
        return f"{name} is marked at frame {frame}"

    def _subject(self, settings: bpy.types.PropertyGroup) -> tuple[str, tuple[Stroke, ...]]:
        """Name and strokes of the subject that is picked."""
        active = None if self.new else subjects.active(settings)
        if active is None:
            return subjects.free_name(settings), ()
        return active.name, subjects.strokes_of(active)

    def overlay(self) -> Overlay:
        return Overlay(self._view, self._scene)

    def begun(self, context: bpy.types.Context) -> None:
        self._name, strokes = self._subject(self._scene.virtual_aperture)
        self._steps = [strokes]
        """The subject's strokes: as they were, and after each that was drawn."""
        self._is_drawing, self._extends = False, False
        self._light_up()
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        is_press = event.value == "PRESS"
        if event.type == "TIMER":
            self._look()
        elif self._is_drawing:
            return self._draw(event)
        elif event.type == "ESC" and is_press:
            if len(self._steps) == 1:
                self._end(context)
                return {"CANCELLED"}
            self.take_back()
            return {"RUNNING_MODAL"}
        elif event.type in {"RET", "NUMPAD_ENTER", "RIGHTMOUSE"} and is_press:
            return self._confirm(context)
        elif event.type == "LEFTMOUSE" and is_press and self._view.holds(event):
            self._press(event)
            return {"RUNNING_MODAL"}
        elif event.type == "MOUSEMOVE":
            self._hover(event)
        # The view may be moved, and another frame shown.
        return {"PASS_THROUGH"}

    def _press(self, event: bpy.types.Event) -> None:
        if (at := self._pressed_at(event)) is None:
            return
        if event.ctrl and not self._masks and not any(stroke.adds for stroke in self._steps[-1]):
            self._say(NOTHING)
        else:
            self._is_drawing, self._extends = True, event.shift
            self._overlay.line, self._overlay.takes = [at], event.ctrl

    def _draw(self, event: bpy.types.Event) -> Result:
        overlay = self._overlay
        if event.type == "ESC":
            self._is_drawing, overlay.line = False, []
        # Those between come where the window was busy.
        elif event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            overlay.extend_line(self._view.place(self._scene, event))
        elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self._is_drawing = False
            overlay.extend_line(self._view.place(self._scene, event))
            stroke = Stroke(clip_frame(self._scene), tuple(overlay.line), not overlay.takes)
            known = self._steps[-1]
            if not any(each.adds for each in known) and (self._extends or overlay.takes):
                known = marked_person(stroke, self._frame, self._masks)
            if not stroke.adds and not known:
                self._say(NOTHING)
            else:
                self._steps.append(with_stroke(known, stroke, self._extends))
                self._light_up()
            overlay.line = []
        self._view.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def take_back(self) -> None:
        if len(self._steps) > 1 and not self._is_drawing:
            self._steps.pop()
            self._light_up()

    def _light_up(self) -> None:
        """Find the subject in the frame that is shown now."""
        if self._work is not None:
            self._work.cancel()
        frame, strokes = clip_frame(self._scene), self._steps[-1]
        self._work, self._people, self._masks, self._frame = None, None, {}, frame
        self._overlay.strokes = [stroke for stroke in strokes if stroke.frame == frame]
        self._say("")
        if frame not in self._context.reconstruction.frames:
            self._overlay.light_up(None)
            return
        if any(each.adds for each in strokes):
            self._work = Work(partial(light_up, self._shot, MarkedSubject(self._name, strokes), frame))
        else:
            self._overlay.light_up(None)
            self._work = self._people = Work(partial(people_of, self._shot, frame))

    def _look(self) -> None:
        """Show what the work has found meanwhile; UserError where it cannot go on."""
        if self._frame != clip_frame(self._scene) and not self._is_drawing:
            self._overlay.light_up(None)
            self._light_up()
        if (work := self._work) is None:
            return
        if not work.ended():
            if work is not self._people:
                self._say(f"Finding {self._name} {work.stage}")
            if work.shown and work.shown[-1] is not self._overlay.mask:
                self._overlay.light_up(work.shown[-1])
            return
        self._work = None
        self._say("")
        if work is self._people:
            self._masks = work.result()
            self._overlay.light_up(united(list(self._masks.values())) if self._masks else None)
        else:
            self._overlay.light_up(work.result())

    def _confirm(self, context: bpy.types.Context) -> Result:
        """Write the strokes, each as one step of undo."""
        self._end(context)
        settings, drawn = self._scene.virtual_aperture, self._steps[1:]
        if not drawn:
            return {"CANCELLED"}
        for number, strokes in enumerate(drawn):
            subjects.set_strokes(settings, self._name, strokes)
            if number + 1 < len(drawn):
                bpy.ops.ed.undo_push(message=self.bl_label)
        redraw.panels()
        frames = sorted({stroke.frame for stroke in drawn[-1]})
        self.report({"INFO"}, f"{self._name} is marked at frame {', '.join(map(str, frames))}")
        return {"FINISHED"}
