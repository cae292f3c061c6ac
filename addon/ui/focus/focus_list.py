"""The list of focus marks, and the operators of a focus pull."""

import bpy

from ...core.base.counting import counted
from ...core.base.errors import UserError
from ...core.focus.place import Place
from ...scene.base.timeline import clip_frame
from ...scene.focus import focus_curve, focus_marks
from ...scene.focus.kept_marks import at_distance
from ...scene.lens import blender_focus
from ...scene.lens.depth_of_field import length_words
from ..base.operators import Edits, has_focus, has_solve, is_met, may_change, polls, requires
from ..base.text import list_row
from ..jobs.report_list import VIRTUAL_APERTURE_OT_jump_to_frame, draw_jump
from ..picking.pick_vertices import focus_on
from . import thumbnails

FRAME, NAME = 0.16, 0.6
"""Shares of a row for the frame's button, and of the rest for thumbnail and name: at Blender's default width
of the sidebar, frame, name and distance are complete. Chosen by inspection."""


has_marks = requires(
    lambda c: len(c.scene.virtual_aperture.marks.items), "There are no focus marks; Pick Focus adds one"
)


class ChangesMarks(Edits):
    """An operator that changes the focus marks, of which there is one at least."""

    poll = polls(may_change, has_solve, has_marks)

    def act(self, context: bpy.types.Context) -> str:
        return self.change(context.scene.virtual_aperture, clip_frame(context.scene))

    def change(self, settings: bpy.types.PropertyGroup, frame: int) -> str:
        """Change the marks; returns a line about it, or raises UserError."""
        raise NotImplementedError


class VIRTUAL_APERTURE_UL_focus_marks(bpy.types.UIList):  # noqa: N801
    """Frame, what was picked, and how far it is there."""

    def draw_item(
        self, context: bpy.types.Context, layout: bpy.types.UILayout, _data: object,
        mark: bpy.types.PropertyGroup, _icon: int, _active_data: object, _active: str, index: int = 0,
    ) -> None:  # fmt: skip
        here = clip_frame(context.scene) == mark.frame
        row = layout.split(factor=FRAME, align=True)
        jump = row.operator(VIRTUAL_APERTURE_OT_jump_to_frame.bl_idname, text=str(mark.frame), depress=here)
        jump.frame = mark.frame
        row = row.split(factor=NAME, align=True)
        # A list's rows are of one height, and an icon is as large as fits; the strip has larger ones.
        thumbnail = thumbnails.icon(context.scene.virtual_aperture, mark)
        row.prop(mark, "name", text="", emboss=False, icon_value=thumbnail)
        away = row.row()
        away.alignment = "RIGHT"
        away.label(text=length_words(context.scene.virtual_aperture, mark.distance))


class VIRTUAL_APERTURE_OT_hold_focus(Edits, bpy.types.Operator):  # noqa: N801
    """Add a focus mark at the current frame that holds the present focus, so that the pull to the next mark
    starts here"""

    bl_label = "Hold Focus Here"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        settings, frame = context.scene.virtual_aperture, clip_frame(context.scene)
        is_free, message = focus_marks.at_frame(settings, frame) is None, f"Frame {frame} already has a mark"
        return may_change(cls, context) and has_focus(cls, context) and is_met(cls, is_free, message)

    def act(self, context: bpy.types.Context) -> str:
        settings, frame = context.scene.virtual_aperture, clip_frame(context.scene)
        if blender_focus.distance(settings) is not None:
            raise UserError("focus is on an object; pick the focus instead")
        return focus_on(settings, frame, held(settings, frame), add=True)


def held(settings: bpy.types.PropertyGroup, frame: int) -> list[Place]:
    """Return the focus at a frame: the places of the mark that is held there, else the distance."""
    marks = settings.marks.items
    if len(marks) and (len(marks) == 1 or frame > marks[-1].frame):
        return list(marks[-1].places)
    if len(marks) and frame < marks[0].frame:
        return list(marks[0].places)
    return [at_distance(settings.focus_distance, frame)]


class VIRTUAL_APERTURE_OT_remove_focus_mark(ChangesMarks, bpy.types.Operator):  # noqa: N801
    """Remove the active focus mark. After the last one, focus stays at its distance"""

    bl_label = "Remove Focus Mark"

    def change(self, settings: bpy.types.PropertyGroup, _frame: int) -> str:
        before = settings.marks.items[settings.marks.active].frame
        focus_marks.remove(settings, settings.marks.active)
        return f"Removed the focus mark at frame {before}"


class VIRTUAL_APERTURE_OT_move_focus_mark(ChangesMarks, bpy.types.Operator):  # noqa: N801
    """Move the active focus mark to the current frame"""

    bl_label = "Move Focus Mark Here"

    def change(self, settings: bpy.types.PropertyGroup, frame: int) -> str:
        before = settings.marks.items[settings.marks.active].frame
        focus_marks.move(settings, settings.marks.active, frame)
        return f"Moved the focus mark from frame {before} to frame {frame}"


class VIRTUAL_APERTURE_OT_write_focus_marks(ChangesMarks, bpy.types.Operator):  # noqa: N801
    """Replace the keyframes of the focus distance with those of the focus marks.

    Your edits to them are lost
    """

    bl_label = "Restore Focus Mark Keys"

    poll = polls(
        may_change, has_solve, has_marks,
        requires(
            lambda c: focus_curve.is_users(c.scene.virtual_aperture),
            "The keyframes are those of the focus marks",
        ),
    )  # fmt: skip

    def change(self, settings: bpy.types.PropertyGroup, _frame: int) -> str:
        focus_marks.take_keys_over(settings)
        return f"Focus follows {counted(len(settings.marks.items), 'mark')} again"


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the list, its operators, and the settings of the active mark."""
    settings = context.scene.virtual_aperture
    group = settings.marks
    side = list_row(layout, "focus_marks", group).column(align=True)
    side.operator("virtual_aperture.pick_focus", text="", icon="ADD").add = True
    side.operator(VIRTUAL_APERTURE_OT_remove_focus_mark.bl_idname, text="", icon="REMOVE")
    side.operator(VIRTUAL_APERTURE_OT_hold_focus.bl_idname, text="", icon="KEYFRAME")
    side.operator(VIRTUAL_APERTURE_OT_move_focus_mark.bl_idname, text="", icon="TRACKING_REFINE_FORWARDS")
    if group.active < len(group.items):
        mark = group.items[group.active]
        if len(group.items) > 1:
            layout.prop(mark, "frame", text="Mark Frame")
        if group.active > 0:
            layout.prop(mark, "easing")
            row = layout.row()
            row.active = mark.easing != "CUT"
            row.prop(mark, "pull")
        layout.prop(mark, "holds")
    hidden = [int(frame) for frame in group.unseen.split()]
    if hidden and not group.is_first:
        line = layout.row(align=True)
        line.label(text=f"Hidden in {counted(len(hidden), 'frame')}", icon="HIDE_ON")
        draw_jump(line, context, hidden)
    # Keys of a typed distance are the user's own, as no mark wrote any.
    is_picked = any(not place.is_bare for mark in group.items for place in mark.places)
    if focus_curve.is_users(settings) and (group.written or is_picked):
        box = layout.column(align=True)
        yours = "deleted" if focus_marks.are_keys_gone(settings) else "edited"
        box.label(text=f"Focus distance keyframes were {yours}", icon="INFO")
        box.operator(VIRTUAL_APERTURE_OT_write_focus_marks.bl_idname)
