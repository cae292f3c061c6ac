"""Warnings: a line each in the main panel, and a popover with the whole text and the way out."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import bpy

from ...core.base.counting import counted
from ...core.base.errors import UserError
from ...core.subjects.networks import MISSING, Networks
from ...render.engine import VirtualApertureEngine
from ...render.views import frame_notes
from ...scene import parts
from ...scene.base import version
from ...scene.edited_camera import edits
from ...scene.ignored import ignored
from ...scene.sources.clip import WHILE_PLAYED, trouble_with
from ..base.operators import check_may_change, sentence
from ..base.solving import running_solve
from ..base.text import wrapped
from ..footage import restore
from ..footage.solve import VIRTUAL_APERTURE_OT_solve
from ..jobs import depth_ahead, render_clip, report_list
from ..picking.pick_subject import VIRTUAL_APERTURE_OT_pick_subject

WIDE = 18
"""Width of the popover in Blender's units of 20 pixels, at a resolution scale of 1."""


@dataclass(frozen=True)
class Notice:
    """A problem of the scene or the clip."""

    short: str
    """The panel's line: its first 17 characters are seen in a sidebar 200 pixels wide."""
    lines: tuple[str, ...]
    """The whole text, in paragraphs."""
    icon: str = "INFO"
    draw_way_out: Callable[[bpy.types.UILayout], object] = lambda layout: None
    """Draws the operators or settings that help."""
    is_advice: bool = False
    """True for a sentence that no button helps with."""


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw a line for each notice, below the button that opens their details; nothing without a notice.

    Advice alone is drawn in its place.
    """
    found = tuple(notices(context))
    if not found:
        return
    if len(found) == 1 and found[0].is_advice:
        wrapped(layout, context, found[0].lines[0], icon=found[0].icon)
        return
    column = layout.column(align=True)
    column.popover(VIRTUAL_APERTURE_PT_details.__name__, text="Details")
    for each in found:
        column.label(text=each.short, icon=each.icon)


def notices(context: bpy.types.Context) -> Iterator[Notice]:
    """Yield the notices of a scene, errors first."""
    settings = context.scene.virtual_aperture
    yield from _scene(context.scene)
    # A solve under way mends the others.
    if running_solve() is not None or version.is_newer(settings):
        return
    is_playing = context.screen is not None and context.screen.is_animation_playing
    yield from _clip(settings, WHILE_PLAYED if is_playing else 0.0)
    if settings.points is None:
        return
    yield from _depth(settings)
    yield from _output(context.scene)
    if settings.marks.is_first and not Networks().exist:
        yield Notice("No people recognized", (sentence(MISSING),))
    if settings.advice:
        yield Notice("Advice on the solve", (sentence(settings.advice),), is_advice=True)
    if frame_notes.of(context.scene):
        yield Notice("Last render: notes", (), draw_way_out=lambda layout: report_list.draw(layout, context))


def _scene(scene: bpy.types.Scene) -> Iterator[Notice]:
    """The scene cannot be changed, or lacks objects."""
    try:
        check_may_change(scene)
    except UserError as error:
        yield Notice("Scene cannot be changed", (sentence(str(error)),), "ERROR")
        return
    if missing := parts.missing(scene):
        is_camera = missing == ["camera"]
        text = "The clip's camera was deleted" if is_camera else "The objects of this solve were deleted"
        objects = restore.VIRTUAL_APERTURE_OT_restore_objects.bl_idname
        yield Notice(
            "Camera was deleted" if is_camera else "Objects were deleted", (text,), "ERROR",
            lambda layout: layout.operator(objects, icon="LOOP_BACK"),
        )  # fmt: skip


def _clip(settings: bpy.types.PropertyGroup, within: float) -> Iterator[Notice]:
    """Another clip than the solved one is chosen, or it is not where the path leads."""
    trouble = trouble_with(settings, within=within)
    if trouble is None:
        return

    def draw_way_out(layout: bpy.types.UILayout) -> None:
        if not trouble.is_missing:
            layout.operator(VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve This Clip", icon="TRACKER")
            return
        row = layout.row(align=True)
        find = restore.VIRTUAL_APERTURE_OT_find_clip.bl_idname
        if trouble.found is not None:
            here = row.operator(find, text="Use New Location", icon="CHECKMARK")
            here.filepath = str(trouble.found)
        row.operator(find, icon="FILE_FOLDER").filepath = ""

    missing = "Clip was moved" if trouble.found is not None else "Clip is missing"
    short = missing if trouble.is_missing else "Solve of another clip"
    yield Notice(short, (sentence(trouble.text),), "ERROR", draw_way_out)


def _depth(settings: bpy.types.PropertyGroup) -> Iterator[Notice]:
    """Depth was not found, or is not sure."""
    found = depth_ahead.of(settings)
    if found is None:
        return
    if found.problem:
        yield Notice("Depth not found", (f"Depth was not found: {found.problem}",), "ERROR")
    elif found.warnings and not len(settings.subjects.items):
        pick = VIRTUAL_APERTURE_OT_pick_subject.bl_idname
        yield Notice(
            "Depth is uncertain", (sentence(found.warnings[-1]),), "QUESTION",
            lambda layout: layout.operator(pick, icon="BRUSH_DATA"),
        )  # fmt: skip


def _output(scene: bpy.types.Scene) -> Iterator[Notice]:
    """Renders have another shape than the clip's, are of another engine, or ignore settings."""
    if problem := render_clip.output_problem(scene):
        use = render_clip.VIRTUAL_APERTURE_OT_use_clip_size.bl_idname
        yield Notice(
            "Output shape differs", (sentence(problem),), "ERROR",
            lambda layout: layout.operator(use, icon="FULLSCREEN_ENTER"),
        )  # fmt: skip
    if scene.render.engine != VirtualApertureEngine.bl_idname:
        yield Notice(
            "F12 without this lens", ("F12 renders with another engine, without this lens",),
            draw_way_out=lambda layout: layout.prop(scene.render, "engine", text=""),
        )  # fmt: skip
    if lines := ignored(scene):
        is_edited = bool(edits(scene))
        short = "Camera edits ignored" if is_edited else f"{counted(len(lines), 'setting')} ignored"
        camera = restore.VIRTUAL_APERTURE_OT_restore_camera.bl_idname
        yield Notice(
            short, lines,
            draw_way_out=lambda layout: is_edited and layout.operator(camera, icon="LOOP_BACK"),
        )  # fmt: skip


def draw_notes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw notes on the solved clip: damage, and uneven frames."""
    settings = context.scene.virtual_aperture
    if settings.points is not None and settings.clip_notes:
        box = layout.box()
        for line in settings.clip_notes.splitlines():
            wrapped(box, context, sentence(line), icon="INFO")


class VIRTUAL_APERTURE_PT_details(bpy.types.Panel):  # noqa: N801
    """The warnings in full, each with the way out"""

    # As Blender's own popovers: drawn where a button asks for it alone.
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_label = "Details"
    bl_ui_units_x = WIDE

    def draw(self, context: bpy.types.Context) -> None:
        for each in notices(context):
            box = self.layout.box()
            for line in each.lines:
                wrapped(box, context, line, icon=each.icon, units=WIDE)
            each.draw_way_out(box)
