"""The first panel: all of the daily work, with the next step as its large button."""

from pathlib import Path

import bpy

from ...core.focus.place import NEAREST
from ...scene.base import version
from ...scene.base.timeline import clip_frame
from ...scene.lens import blender_focus, depth_of_field, lens
from ..base import solving
from ..base.text import is_narrow, progress_row, wrapped
from ..focus import lens_amount
from ..footage import file_import, photos, solve
from ..jobs import depth_ahead, first_person, movie, render_clip, report_list
from ..picking import pick_focus, pick_vertices, set_scale
from . import live_preview, notices, render
from .panel import PRIMARY, Panel, split

MOST_MARKS = 5
"""Focus marks that have a button each: more would be too narrow in a sidebar 250 pixels wide."""
WORDED = 2
"""Most focus marks beside whose buttons words are complete. Measured in a window."""
BUTTON = 12
"""Pixels of a row that a small button takes of its text, at a resolution scale of 1. Chosen by inspection."""
HINT = "Drop a video or an image of a sequence on the viewport, or choose a clip or a folder"
"""Blender hands no add-on a folder that is dropped."""
UNIT = 0.75
"""Share of a row that a number has which is followed by words. Chosen by inspection."""


class VIRTUAL_APERTURE_PT_main(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Virtual Aperture"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return True

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.virtual_aperture, self.layout
        running = solving.running_solve()
        if running is not None:
            layout.label(text=running.clip, icon="FILE_MOVIE")
        elif settings.footage:
            _draw_clip(layout, settings)
        if version.is_newer(settings):
            notices.draw(layout, context)
            return
        if running is not None:
            step = running.step
            progress_row(layout, step.text, step.share, step.left, hint="ESC cancels")
        elif not settings.footage:
            wrapped(layout, context, HINT, icon="IMPORT")
            _large(layout).operator(file_import.VIRTUAL_APERTURE_OT_choose_clip.bl_idname, icon="FILEBROWSER")
        elif settings.points is None:
            _draw_unsolved(layout, context)
        else:
            _draw_solved(layout, context)
        # Last: a warning moves no button.
        notices.draw(layout, context)


def _large(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    row = layout.row(align=True)
    row.scale_y = PRIMARY
    return row


def _pair(layout: bpy.types.UILayout, context: bpy.types.Context) -> bpy.types.UILayout:
    """Return the place of two large buttons: side by side, or one below the other in a narrow sidebar."""
    column = layout.column(align=True) if is_narrow(context) else layout.row(align=True)
    column.scale_y = PRIMARY
    return column


def _draw_clip(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    row = layout.row(align=True)
    name = Path(settings.footage).name
    row.operator(file_import.VIRTUAL_APERTURE_OT_choose_clip.bl_idname, text=name, icon="FILE_MOVIE")
    if photos.are_photos(settings):
        row.operator(photos.VIRTUAL_APERTURE_OT_show_photo.bl_idname, text="", icon="IMAGE_DATA")


def _draw_unsolved(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.virtual_aperture
    if photos.may_be_photos(settings):
        layout.prop(settings, "stills")
    wrapped(layout, context, "Solve the clip to find its camera motion and depth", icon="INFO")
    name = solve.VIRTUAL_APERTURE_OT_solve.bl_idname
    _large(layout).operator(name, icon="TRACKER").again = False


def _draw_solved(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    settings = context.scene.virtual_aperture
    layout.label(text="Solved", icon="CHECKMARK")
    row = _pair(layout, context)
    is_shown = live_preview.is_shown(context)
    row.operator(
        live_preview.VIRTUAL_APERTURE_OT_preview.bl_idname, text="End Preview" if is_shown else "Preview",
        icon="SHADING_RENDERED", depress=is_shown,
    )  # fmt: skip
    row.operator(pick_focus.VIRTUAL_APERTURE_OT_pick_focus.bl_idname, icon="EYEDROPPER")
    if settings.points.mode == "EDIT":
        wrapped(layout, context, "Select vertices on what should be sharp, ideally four", icon="INFO")
        _large(layout).operator(pick_vertices.VIRTUAL_APERTURE_OT_set_focus.bl_idname, icon="PIVOT_MEDIAN")
    _draw_marks(layout, context)
    _draw_amount(layout, context)
    row = _pair(layout, context)
    # Without icons: in a narrow sidebar they would cut their names off.
    row.operator(render_clip.VIRTUAL_APERTURE_OT_render_frame.bl_idname)
    row.operator(render_clip.VIRTUAL_APERTURE_OT_render_clip.bl_idname)
    wrapped(layout, context, render.output_words(context.scene), icon="OUTPUT")
    movie.draw(layout)
    depth_ahead.draw_progress(layout, settings)
    if searching := first_person.words():
        wrapped(layout, context, searching, icon="TIME")


def _draw_marks(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the focus, and a button for the frame of each focus mark."""
    settings, frame = context.scene.virtual_aperture, clip_frame(context.scene)
    if (thing := blender_focus.focus_object(settings)) is not None:
        layout.label(text=f"In focus: {thing.name}", icon="OBJECT_DATA")
        return
    marks = settings.marks.items
    if not len(marks):
        if not lens.is_in_focus(settings):
            wrapped(layout, context, "Pick Focus, then click what should be sharp", icon="INFO")
        return
    row = layout.row(align=True)
    if len(marks) == 1:
        name = first_person.in_focus(settings) if settings.marks.is_first else marks[0].name
        # The first focus of a clip without subjects is on its nearest large object.
        text = "Automatic focus" if name == NEAREST else f"In focus: {name}"
        wrapped(row, context, text, icon="KEYFRAME_HLT", beside=BUTTON)
    else:
        # More buttons, or a narrow sidebar, would cut the words off.
        has_words = len(marks) <= WORDED and not is_narrow(context)
        row.label(text="Focus at" if has_words else "", icon="NONE" if has_words else "KEYFRAME_HLT")
    for mark in marks[:MOST_MARKS] if len(marks) > 1 else ():
        jump = row.operator(
            report_list.VIRTUAL_APERTURE_OT_jump_to_frame.bl_idname, text=str(mark.frame),
            depress=mark.frame == frame,
        )  # fmt: skip
        jump.frame = mark.frame
    row.operator(pick_focus.VIRTUAL_APERTURE_OT_pick_focus.bl_idname, text="", icon="ADD").add = True


def _draw_amount(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the amount of blur, and the button for the scale while that is not given."""
    settings = context.scene.virtual_aperture
    lens_amount.draw(split(layout.column(align=True)), context)
    if not settings.metres_per_unit > 0 and depth_of_field.subject_metres(settings) > 0:
        layout.operator(set_scale.VIRTUAL_APERTURE_OT_set_scale.bl_idname, icon="DRIVER_DISTANCE")


def draw_subject(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """Draw the distance of the subject, which gives the scale; an assumed one is marked."""
    column = layout.column(align=True)
    if not settings.metres_per_unit > 0:
        column.label(text="Distance to subject (guess)", icon="DRIVER_DISTANCE")
    row = column.split(factor=UNIT, align=True)
    row.use_property_split = False
    row.prop(settings, "subject_metres", text="")
    row.label(text="m away")
    column.operator(set_scale.VIRTUAL_APERTURE_OT_set_scale.bl_idname)
