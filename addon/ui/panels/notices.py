"""Warnings in panels."""

from __future__ import annotations

import bpy

from ...core.base.errors import UserError
from ...render.engine import VirtualApertureEngine
from ...scene import parts
from ...scene.ignored import ignored
from ...scene.sources.clip import trouble_with
from ..base.operators import check_may_change, sentence
from ..base.solving import running_solve
from ..base.text import wrapped
from ..footage.find_clip import VIRTUAL_APERTURE_OT_find_clip
from ..footage.restore import VIRTUAL_APERTURE_OT_restore_objects
from ..footage.solve import VIRTUAL_APERTURE_OT_solve
from ..jobs import depth_ahead, render_clip
from ..picking.pick_subject import VIRTUAL_APERTURE_OT_pick_subject


def draw_scene(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a warning that the scene cannot be changed, or lacks objects, with the way out."""
    try:
        check_may_change(context.scene)
    except UserError as error:
        wrapped(layout.box(), context, sentence(str(error)), icon="ERROR")
        return
    if missing := parts.missing(context.scene):
        box = layout.box()
        text = (
            "The clip's camera was deleted"
            if missing == ["camera"]
            else "The objects of this solve were deleted"
        )
        wrapped(box, context, text, icon="ERROR")
        box.operator(VIRTUAL_APERTURE_OT_restore_objects.bl_idname, icon="LOOP_BACK")


def draw_clip(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Another clip than the solved one is chosen, or it is not where the path leads: and the way out.

    Nothing while a clip is being solved, which is the way out.
    """
    if running_solve() is not None:
        return
    trouble = trouble_with(context.scene.virtual_aperture)
    if trouble is None:
        return
    box = layout.box()
    wrapped(box, context, sentence(trouble.text), icon="ERROR")
    if not trouble.is_missing:
        box.operator(VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve This Clip", icon="TRACKER")
        return
    row = box.row(align=True)
    if trouble.found is not None:
        here = row.operator(
            VIRTUAL_APERTURE_OT_find_clip.bl_idname, text="Use New Location", icon="CHECKMARK"
        )
        here.filepath = str(trouble.found)
    row.operator(VIRTUAL_APERTURE_OT_find_clip.bl_idname, icon="FILE_FOLDER").filepath = ""


def draw_notes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw notes on the solved clip: damage, and uneven frames."""
    settings = context.scene.virtual_aperture
    if settings.points is not None and settings.clip_notes:
        box = layout.box()
        for line in settings.clip_notes.splitlines():
            wrapped(box, context, sentence(line), icon="INFO")


def draw_depth(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a warning that depth was not found, or is not sure, with the way out."""
    settings = context.scene.virtual_aperture
    found = depth_ahead.of(settings)
    if found is None:
        return
    if found.problem:
        wrapped(layout.box(), context, f"Depth was not found: {found.problem}", icon="ERROR")
    elif found.warnings and not len(settings.subjects.items):
        box = layout.box()
        wrapped(box, context, sentence(found.warnings[-1]), icon="QUESTION")
        box.operator(VIRTUAL_APERTURE_OT_pick_subject.bl_idname, icon="BRUSH_DATA")


def draw_shape(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Report an output size of another shape than the clip's, with the way out."""
    problem = render_clip.output_problem(context.scene)
    if problem:
        box = layout.box()
        wrapped(box, context, sentence(problem), icon="ERROR")
        box.operator(render_clip.VIRTUAL_APERTURE_OT_use_clip_size.bl_idname, icon="FULLSCREEN_ENTER")


def draw_engine(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Report that F12 renders with another engine, with the way out."""
    render = context.scene.render
    if render.engine != VirtualApertureEngine.bl_idname:
        box = layout.box()
        wrapped(box, context, "F12 renders with another engine, without this lens", icon="INFO")
        box.prop(render, "engine", text="")


def draw_ignored(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the settings of the scene that renders ignore."""
    if lines := ignored(context.scene):
        box = layout.box()
        for line in lines:
            wrapped(box, context, line, icon="INFO")
