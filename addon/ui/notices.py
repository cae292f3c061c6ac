"""What panels tell of what will not go as the user may think."""

from __future__ import annotations

import textwrap

import bpy

from ..scene.clip import trouble_with
from ..scene.ignored import ignored
from .find_clip import VIRTUAL_APERTURE_OT_find_clip
from .operators import VIRTUAL_APERTURE_OT_solve

LETTER = 6.5
"""Width of a letter in pixels, at a scale of 1; a label that is too long for its panel loses its middle."""
NARROWEST = 24


def draw_clip(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Another clip than the solved one is chosen, or it is not where the path leads: and the way out."""
    trouble = trouble_with(context.scene.virtual_aperture)
    if trouble is None:
        return
    box = layout.box()
    draw_text(box, context, trouble.text[0].upper() + trouble.text[1:], "ERROR")
    if not trouble.is_missing:
        box.operator(VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve This Clip", icon="TRACKER")
        return
    row = box.row(align=True)
    if trouble.found is not None:
        here = row.operator(VIRTUAL_APERTURE_OT_find_clip.bl_idname, text="Use It There", icon="CHECKMARK")
        here.filepath = str(trouble.found)
    row.operator(VIRTUAL_APERTURE_OT_find_clip.bl_idname, icon="FILE_FOLDER").filepath = ""


def draw_ignored(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What the scene asks for and the render will not give."""
    if lines := ignored(context.scene):
        box = layout.box()
        for line in lines:
            draw_text(box, context, line, "INFO")


def draw_text(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str) -> None:
    """A text in as many labels as the panel's width asks for, the icon before the first one."""
    letter = LETTER * context.preferences.system.ui_scale
    # Without a window there is no scale.
    letters = int(context.region.width / letter) - 8 if letter and context.region is not None else NARROWEST
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in textwrap.wrap(text, max(letters, NARROWEST), break_on_hyphens=False):
        column.label(text=line, icon=icon)
        icon = "BLANK1"
