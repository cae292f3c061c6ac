"""Painting a repair over a mistake of the depth, in the camera's picture, and the list of repairs."""

from dataclasses import replace

import bpy

from ...core.base.errors import UserError
from ...core.focus.picking import unsolved
from ...core.frame.repairs import KINDS, Repair, check_repair
from ...core.subjects.strokes import places_of
from ...scene.base import redraw
from ...scene.base.timeline import clip_frame
from ...scene.lens import repairs
from ...scene.sources import subjects
from ...scene.sources.shot import reconstruction_of
from ..base.operators import Edits, Result, may_change, polls, requires
from ..base.text import list_row
from .pick_in_view import EXAMPLE, STROKE, PicksInView
from .pick_view import Overlay

FINER = 0.85
"""Factor on the brush with each press of [."""


class VIRTUAL_APERTURE_OT_paint_repair(PicksInView, bpy.types.Operator):  # noqa: N801
    """Paint over a mistake of the depth in the camera view.

    The stroke is carried through the clip. [ and ] change the size of the brush
    """

    places: STROKE
    reference: bpy.props.StringProperty(
        name="Reference",
        description="Place with the right depth, for Same as Here, such as 0.4,0.5",
        options={"SKIP_SAVE"},
    )

    doing, cursor = "Paint", "PAINT_BRUSH"

    def act(self, context: bpy.types.Context) -> str:
        try:
            places = places_of(self.places.split())
            reference = next(iter(places_of(self.reference.split())), None)
        except ValueError:
            raise UserError(
                f"the stroke {self.places!r} is not valid; write places such as {EXAMPLE}"
            ) from None
        return self._keep(context.scene, places, reference)

    def _keep(
        self,
        scene: bpy.types.Scene,
        places: tuple[tuple[float, float], ...],
        reference: tuple[float, float] | None,
    ) -> str:
        """Add the stroke to the repairs; returns a line about it. UserError where it is not valid."""
        settings, frame = scene.virtual_aperture, clip_frame(scene)
        if frame not in (solved := reconstruction_of(settings)).frames:
            raise UserError(unsolved(solved, frame))
        brush = settings.repairs
        made = Repair(brush.kind.lower(), frame, places, brush.radius, brush.amount)
        if made.kind == "same":
            made = replace(made, reference=reference)
        check_repair(made)
        repairs.add_repairs(settings, [made])
        redraw.panels()
        return f"Painted {KINDS[made.kind]} at frame {frame}; Ctrl Z takes it back"

    def overlay(self) -> Overlay:
        return Overlay(self._view, self._scene)

    def begun(self, context: bpy.types.Context) -> None:
        self._is_drawing = False
        self._reference: tuple[float, float] | None = None
        self._tell()

    def take_back(self) -> None:
        if not self._is_drawing:
            self._reference, self._overlay.picked, self._overlay.line = None, [], []
            self._tell()

    def _tell(self) -> None:
        """Show what the next press of the mouse does."""
        brush = self._scene.virtual_aperture.repairs
        self._overlay.brush = brush.radius
        if self._overlay.line:
            self._say("Click where the depth is right", "ESC: Cancel")
        elif brush.kind == "SAME" and self._reference is None:
            keys = "Drag: Paint First    [ ]: Brush Size    ESC: Cancel"
            self._say("Click where the depth is right, then paint over the mistake", keys)
        else:
            name = KINDS[brush.kind.lower()]
            self._say(f"Paint {name} over the mistake", "Drag: Paint    [ ]: Brush Size    ESC: Cancel")

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        is_press = event.value == "PRESS"
        if event.type in {"ESC", "RIGHTMOUSE"} and is_press:
            self._end(context)
            return {"CANCELLED"}
        if self._is_drawing:
            return self._draw(context, event)
        if event.type in {"LEFT_BRACKET", "RIGHT_BRACKET"} and is_press:
            brush = self._scene.virtual_aperture.repairs
            # The property keeps it within its bounds.
            brush.radius *= FINER if event.type == "LEFT_BRACKET" else 1 / FINER
            self._tell()
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and is_press and self._view.holds(event):
            return self._press(context, event)
        if event.type == "MOUSEMOVE":
            self._hover(event)
        # The view may be moved, and another frame shown.
        return {"PASS_THROUGH"}

    def _press(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        at = self._pressed_at(event)
        if at is not None and self._overlay.line:
            self._reference = at
            return self._finish(context)
        if at is not None:
            self._is_drawing, self._overlay.line = True, [at]
        return {"RUNNING_MODAL"}

    def _draw(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        # Events between two come where the window was busy.
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE", "LEFTMOUSE"}:
            self._overlay.extend_line(self._view.place(self._scene, event))
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            return self._released(context)
        self._view.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def _released(self, context: bpy.types.Context) -> Result:
        """Take a stroke, or the click that gives Same as Here its reference; either may come first."""
        self._is_drawing, line = False, self._overlay.line
        if self._scene.virtual_aperture.repairs.kind != "SAME" or self._reference is not None:
            return self._finish(context)
        if len(line) == 1:
            self._reference, self._overlay.picked, self._overlay.line = line[0], line, []
        self._tell()
        return {"RUNNING_MODAL"}

    def _finish(self, context: bpy.types.Context) -> Result:
        self._end(context)
        self.report({"INFO"}, self._keep(self._scene, tuple(self._overlay.line), self._reference))
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_remove_repair(Edits, bpy.types.Operator):  # noqa: N801
    """Remove the active repair"""

    poll = polls(
        may_change,
        requires(lambda c: len(c.scene.virtual_aperture.repairs.items), "Nothing has been repaired"),
    )

    def act(self, context: bpy.types.Context) -> str:
        group = context.scene.virtual_aperture.repairs
        kept = group.items[group.active]
        said = f"Removed the repair {kept.name} of frame {kept.frame}"
        subjects.remove_active(group)
        return said


class VIRTUAL_APERTURE_UL_repairs(bpy.types.UIList):  # noqa: N801
    """Kind and frame of each repair."""

    def draw_item(
        self, _context: bpy.types.Context, layout: bpy.types.UILayout, _data: object,
        repair: bpy.types.PropertyGroup, _icon: int, _active_data: object, _active: str, index: int = 0,
    ) -> None:  # fmt: skip
        row = layout.split(factor=0.65)
        row.label(text=KINDS[repair.kind.lower()], icon="BRUSH_DATA")
        row.label(text=f"frame {repair.frame}")


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the brush, its operator, and the list of repairs."""
    group = context.scene.virtual_aperture.repairs
    layout.prop(group, "kind")
    layout.prop(group, "radius")
    amount = layout.row()
    amount.active = group.kind in {"NEARER", "FARTHER"}
    amount.prop(group, "amount")
    layout.operator(VIRTUAL_APERTURE_OT_paint_repair.bl_idname, icon="BRUSH_DATA")
    if len(group.items):
        remove = VIRTUAL_APERTURE_OT_remove_repair.bl_idname
        list_row(layout, "repairs", group).operator(remove, text="", icon="REMOVE")
