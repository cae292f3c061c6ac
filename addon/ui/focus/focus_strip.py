"""The focus strip: thumbnails of the focus marks, and of suggested ones, at the bottom of the camera view.

A handler draws it, so that it is visible during playback, too. An invisible gizmo takes clicks and drags on
thumbnails only: other uses of the mouse in the view are unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import blf
import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...render.viewport.overlay import TOP_DOWN, draw_texture, fill
from ...scene.base.timeline import clip_frame, go_to
from ...scene.focus import focus_marks
from ...scene.lens.depth_of_field import length_words
from ..base.operators import Result
from ..picking.pick_view import GREEN, SHADE, WHITE, line
from . import thumbnails
from .focus_list import ChangesMarks

SIDE, GAP, EDGE, ROW, TRACK = 48.0, 26.0, 12.0, 14.0, 12.0
"""Pixels at a resolution scale of 1: a thumbnail's side, what is free between two, the strip's edge, a row of
text, and the height of the track with its ticks. Chosen by inspection: a gap leaves room for a name."""
TEXT = 10
"""Points."""
SLACK = 4
"""Pixels that the mouse moves before a click is a drag, at a resolution scale of 1. Blender's own are 3."""
GREY, AMBER = (0.75, 0.75, 0.75, 1.0), (1.0, 0.7, 0.2, 1.0)
"""Colours of marks, and of suggested ones."""
PICKERS = {"VIRTUAL_APERTURE_OT_pick_focus", "VIRTUAL_APERTURE_OT_pick_subject"}
"""Operators whose clicks go to the picture, which the strip would cover."""


def spread(places: Sequence[float], apart: float, low: float, high: float) -> Floats:
    """Return positions (n,) with a least distance, as near as possible to given ones.

    They are in ascending order, from `low` to `high`, by least squares; closer where there is no room.
    """
    count = len(places)
    if count == 0:
        return np.zeros(0)
    apart = min(apart, (high - low) / max(count - 1, 1))
    steps = apart * np.arange(count)
    # Less their distances they only ascend: the isotonic regression, by the means of all runs.
    sums = np.concatenate([[0.0], np.cumsum(np.asarray(places, np.float64) - steps)])
    first, last = np.mgrid[:count, :count]
    means = np.where(last >= first, (sums[last + 1] - sums[first]) / np.maximum(last - first + 1, 1), np.inf)
    least = np.minimum.accumulate(means[:, ::-1], axis=1)[:, ::-1]
    least = np.where(last >= first, least, -np.inf)
    ascending: Floats = np.clip(least.max(axis=0), low, high - steps[-1])
    return ascending + steps


@dataclass(frozen=True)
class Strip:
    """Where the strip is in a region, in its pixels, (0, 0) bottom left."""

    left: float
    """Position of the first frame on the track; `right` of the last one."""
    right: float
    bottom: float
    """Lower edge of the strip."""
    scale: float
    first: int
    last: int
    frames: tuple[int, ...]
    """Those of `marks_shown`."""
    own: int
    """Number of the user's marks among them, which come first."""
    middles: Floats
    """(n,) of the marks' thumbnails: at their frames, or beside them where two would cover each other."""

    @classmethod
    def over(cls, low: float, high: float, bottom: float, scale: float, scene: bpy.types.Scene) -> Strip:
        """Return the strip of a scene's marks between two pixels."""
        margin = (EDGE + SIDE / 2) * scale
        left, right = low + margin, max(high - margin, low + margin + 1)
        marks, group = marks_shown(scene.virtual_aperture), scene.virtual_aperture.marks
        frames, own = tuple(mark.frame for mark in marks), len(marks) - len(group.suggested)
        middles, ends = np.zeros(len(frames)), (scene.frame_start, scene.frame_end)
        strip = cls(left, right, bottom, scale, *ends, frames, own, middles)
        order = np.argsort(frames, kind="stable")
        places = [strip.place_of(frames[n]) for n in order]
        middles[order] = spread(places, (SIDE + GAP) * scale, left, right)
        return strip

    @property
    def track(self) -> float:
        """Height of the track."""
        return self.bottom + EDGE * self.scale

    @property
    def thumbnails(self) -> float:
        """Lower edge of the thumbnails."""
        return self.track + (TRACK + 2 * ROW) * self.scale

    @property
    def top(self) -> float:
        return self.thumbnails + (SIDE + EDGE) * self.scale

    def place_of(self, frame: int) -> float:
        """Return the position of a frame on the track; frames outside of the scene's are at its ends."""
        share = (frame - self.first) / max(self.last - self.first, 1)
        return self.left + float(np.clip(share, 0, 1)) * (self.right - self.left)

    def frame_at(self, x: float) -> int:
        """Return the frame of the scene that is nearest to a place."""
        share = float(np.clip((x - self.left) / (self.right - self.left), 0, 1))
        return self.first + round(share * (self.last - self.first))

    def mark_at(self, x: float, y: float) -> int | None:
        """Return the number of the mark whose thumbnail, or what is written below it, is at a place."""
        if not (len(self.frames) and self.track + TRACK * self.scale <= y <= self.top):
            return None
        away = np.abs(self.middles - x)
        nearest = int(away.argmin())
        return nearest if away[nearest] <= SIDE / 2 * self.scale else None


def marks_shown(settings: bpy.types.PropertyGroup) -> list[bpy.types.PropertyGroup]:
    """Return the marks that the user has picked, in their order, and then the suggested ones."""
    return [*(() if settings.marks.is_first else settings.marks.items), *settings.marks.suggested]


def strip_of(context: bpy.types.Context) -> Strip | None:
    """Return the strip of a 3D viewport; None where there is none.

    There is none outside of the solved camera's view, without overlays, before the first mark is picked or
    suggested, and during a pick.
    """
    scene, space, region, view = context.scene, context.space_data, context.region, context.region_data
    settings = scene.virtual_aperture
    if not (space.overlay.show_overlays and marks_shown(settings)):
        return None
    looked = space.camera if space.use_local_camera else scene.camera
    if view is None or view.view_perspective != "CAMERA" or looked is None or looked != settings.camera:
        return None
    if any(each.bl_idname in PICKERS for each in context.window.modal_operators):
        return None
    # Regions may lie over the view; of four views each is a region of this type.
    others = (each for each in context.area.regions if each.type != "WINDOW")
    beside = [each for each in others if min(each.width, each.height) > 1]
    # Blender's panel of the last operation floats in the lower left corner.
    low = max([0, *(r.x + r.width - region.x for r in beside if r.alignment in {"LEFT", "FLOAT"})])
    high = min([region.width, *(r.x - region.x for r in beside if r.alignment == "RIGHT")])
    bottom = max([0, *(r.y + r.height - region.y for r in beside if r.alignment == "BOTTOM")])
    return Strip.over(low, high, bottom, context.preferences.system.ui_scale, scene)


class VIRTUAL_APERTURE_OT_drag_focus_mark(ChangesMarks, bpy.types.Operator):  # noqa: N801
    """Click to go to this focus mark or to take a suggestion, drag to move a mark to another frame"""

    bl_label = "Drag Focus Mark"
    # Not REGISTER: the panel of a redo would cover the strip.
    bl_options = {"UNDO"}  # noqa: RUF012

    index: bpy.props.IntProperty(name="Focus Mark", min=0, options={"SKIP_SAVE"})
    frame: bpy.props.IntProperty(name="Frame", description="Frame to move it to", options={"SKIP_SAVE"})

    dragged: tuple[int, int] | None = None
    """Class attribute: the frame that a mark is dragged from, and the one under the mouse."""

    def change(self, settings: bpy.types.PropertyGroup, _frame: int) -> str:
        if self.index >= len(settings.marks.items):
            raise UserError(
                f"there is no focus mark {self.index}; the last one is {len(settings.marks.items) - 1}"
            )
        before = settings.marks.items[self.index].frame
        focus_marks.move(settings, self.index, self.frame)
        return f"Moved the focus mark from frame {before} to frame {self.frame}"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        self._strip = strip_of(context)
        x, y = event.mouse_region_x, event.mouse_region_y
        found = self._strip.mark_at(x, y) if self._strip is not None else None
        if self._strip is None or found is None:
            return {"CANCELLED"}
        if found >= self._strip.own:
            taken: Result = bpy.ops.virtual_aperture.take_suggestion(frame=self._strip.frames[found])
            return taken
        self.index, self._begun, self._area, self._moves = found, x, context.area, False
        self._from = self.frame = self._strip.frames[found]
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS":
            self._end(context)
            return {"CANCELLED"}
        if event.type == "MOUSEMOVE":
            self._drag(context, event.mouse_region_x)
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self._drop(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile."""
        self._end(context)

    def _drag(self, context: bpy.types.Context, x: float) -> None:
        """Move it along with the mouse, from where it was taken."""
        assert self._strip is not None
        self._moves = self._moves or abs(x - self._begun) > SLACK * self._strip.scale
        if not self._moves:
            return
        over = self._strip.frame_at(self._strip.place_of(self._from) + x - self._begun)
        self.frame = self._free(over)
        type(self).dragged = self._from, self.frame
        self._area.header_text_set(f"Focus mark: frame {self._from} to {self.frame}    ESC: Cancel")
        self._area.tag_redraw()

    def _free(self, frame: int) -> int:
        """The frame nearest to one that no other mark is at."""
        assert self._strip is not None
        free = np.arange(self._strip.first, self._strip.last + 1)
        free = free[~np.isin(free, [each for each in self._strip.frames if each != self._from])]
        return int(free[np.abs(free - frame).argmin()]) if len(free) else self._from

    def _drop(self, context: bpy.types.Context) -> Result:
        self._end(context)
        done = self.execute(context) if self.frame != self._from else {"FINISHED"}
        focus_marks.activate(context.scene.virtual_aperture.marks, self.frame)
        go_to(context.scene, self.frame)
        return done

    def _end(self, _context: bpy.types.Context) -> None:
        type(self).dragged = None
        self._area.header_text_set(None)
        self._area.tag_redraw()


class VIRTUAL_APERTURE_GT_focus_strip(bpy.types.Gizmo):  # noqa: N801
    """Takes the mouse over the strip's thumbnails; the strip itself is drawn by a handler."""

    bl_idname = "VIRTUAL_APERTURE_GT_focus_strip"

    def setup(self) -> None:
        """Prepare nothing; Blender requires this method."""

    def draw(self, _context: bpy.types.Context) -> None:
        """Draw nothing: see `_draw`."""

    def test_select(self, context: bpy.types.Context, location: Sequence[int]) -> int:
        """Return 0 over a thumbnail, else -1."""
        strip = strip_of(context)
        return 0 if strip is not None and strip.mark_at(*location) is not None else -1


class VIRTUAL_APERTURE_GGT_focus_strip(bpy.types.GizmoGroup):  # noqa: N801
    """The strip's gizmo in 3D viewports."""

    bl_idname = "VIRTUAL_APERTURE_GGT_focus_strip"
    bl_label = "Focus Strip"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return strip_of(context) is not None

    def setup(self, _context: bpy.types.Context) -> None:
        gizmo = self.gizmos.new(VIRTUAL_APERTURE_GT_focus_strip.bl_idname)
        gizmo.target_set_operator(VIRTUAL_APERTURE_OT_drag_focus_mark.bl_idname)


def draw() -> None:
    """Draw the strip of the scene's focus marks."""
    context = bpy.context
    strip = strip_of(context)
    if strip is None:
        return
    settings, scale = context.scene.virtual_aperture, strip.scale
    beyond = (SIDE / 2 + EDGE) * scale
    fill((strip.left - beyond, strip.bottom, strip.right + beyond, strip.top), SHADE)
    line([(strip.left, strip.track), (strip.right, strip.track)], GREY, scale)
    now = strip.place_of(clip_frame(context.scene))
    line([(now, strip.track - 4 * scale), (now, strip.track + 6 * scale)], GREEN, 2 * scale)
    dragged = VIRTUAL_APERTURE_OT_drag_focus_mark.dragged
    marks = marks_shown(settings)
    order = sorted(range(len(marks)), key=lambda n: n == settings.marks.active)
    for n in order:
        mark, middle = marks[n], float(strip.middles[n])
        frame, colour = mark.frame, AMBER if n >= strip.own else WHITE if n == settings.marks.active else GREY
        if dragged is not None and dragged[0] == frame:
            frame, colour = dragged[1], GREEN
            middle = strip.place_of(frame)
        _draw_mark(strip, mark, frame, middle, colour)


def _draw_mark(
    strip: Strip, mark: bpy.types.PropertyGroup, frame: int, middle: float, colour: tuple[float, ...]
) -> None:
    """A mark's thumbnail with its rim, what is written below it, and its tick on the track."""
    scale = strip.scale
    half, low = SIDE / 2 * scale, strip.thumbnails
    tick = strip.place_of(frame)
    line([(tick, strip.track), (middle, strip.track + TRACK * scale)], colour, scale)
    settings = mark.id_data.virtual_aperture
    left, right, high = middle - half, middle + half, low + 2 * half
    texture = thumbnails.texture(settings, mark)
    if texture is None:
        fill((left, low, right, high), SHADE)
    else:
        draw_texture(texture, (left, low, right, high), part=TOP_DOWN)
    rim = [(left, low), (right, low), (right, high), (left, high), (left, low)]
    line(rim, colour, (2 if colour != GREY else 1) * scale)
    away = length_words(settings, mark.distance)
    for row, text in enumerate((f"{frame}  {away}", mark.name)):
        _text(text, middle, low - (row + 0.85) * ROW * scale, colour, scale)


def _text(text: str, middle: float, bottom: float, colour: tuple[float, ...], scale: float) -> None:
    blf.size(0, TEXT * scale)
    blf.color(0, *colour)
    blf.position(0, middle - blf.dimensions(0, text)[0] / 2, bottom, 0)
    blf.draw(0, text)
