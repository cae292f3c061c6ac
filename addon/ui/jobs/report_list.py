"""The list of the last render's notes on frames, with a jump to them."""

from collections.abc import Sequence

import bpy

from ...core.base.counting import ranges
from ...render.views import frame_notes
from ...scene.base.timeline import clip_frame, go_to
from ...scene.focus import focus_marks
from ..base.operators import Acts
from ..base.text import wrapped

LONGEST = 5
"""Things that the panel lists."""


class VIRTUAL_APERTURE_OT_jump_to_frame(Acts, bpy.types.Operator):  # noqa: N801
    """Show this frame"""

    bl_label = "Jump to Frame"
    # As Blender's own jumps.
    bl_options = {"UNDO_GROUPED"}  # noqa: RUF012
    bl_undo_group = "Frame Change"

    frame: bpy.props.IntProperty(name="Frame")

    def act(self, context: bpy.types.Context) -> None:
        go_to(context.scene, self.frame)
        focus_marks.activate(context.scene.virtual_aperture.marks, self.frame)


def next_of(frames: Sequence[int], now: int) -> int:
    """Return the first of the frames after the present one, else the first of all."""
    return next((frame for frame in frames if frame > now), frames[0])


def draw_jump(row: bpy.types.UILayout, context: bpy.types.Context, frames: Sequence[int]) -> None:
    """Draw a button that goes to the next of the frames."""
    jump = row.operator(VIRTUAL_APERTURE_OT_jump_to_frame.bl_idname, text="", icon="FRAME_NEXT")
    jump.frame = next_of(frames, clip_frame(context.scene))


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the notes with their frames, each with a button to the next of them."""
    notes = frame_notes.of(context.scene)
    if not notes:
        return
    box = layout.box()
    box.label(text="The Last Render", icon="INFO")
    for note in notes[:LONGEST]:
        row = box.row()
        numbers = ranges(list(note.frames))
        wrapped(row, context, f"Frame{'s' if len(note.frames) > 1 else ''} {numbers}: {note.text}")
        draw_jump(row, context, note.frames)
    if len(notes) > LONGEST:
        box.label(text=f"and {len(notes) - LONGEST} more, in the Info editor")
