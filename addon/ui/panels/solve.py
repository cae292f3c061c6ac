"""The Solve panel: where the camera was, and how far things are."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...core.media.clip import is_pattern
from ...scene import masks
from .. import after_solve, depth_ahead, operators
from ..pick_subject import VIRTUAL_APERTURE_OT_pick_subject
from ..text import wrapped
from .panel import PRIMARY, ClosedPanel, Panel, split


class VIRTUAL_APERTURE_PT_solve(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Solve"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        running = operators.running_solve()
        if running is not None:
            layout.progress(factor=running.step.share, text=f"{running.step.text} (ESC cancels)")
        clip = Path(settings.footage)
        # A folder, by its name: nothing is looked up while the panel is drawn.
        if settings.footage and (not clip.suffix or is_pattern(clip)):
            layout.prop(settings, "stills")
        layout.prop(settings, "lens")
        if settings.lens == "GIVEN":
            layout.prop(settings, "equivalent")
        elif settings.lens == "SENSOR":
            layout.prop(settings, "focal_mm")
            layout.prop(settings, "sensor_mm")
        row = layout.row()
        row.scale_y = PRIMARY
        row.operator(operators.VIRTUAL_APERTURE_OT_solve.bl_idname, icon="TRACKER").again = False
        if settings.points is not None or operators.is_kept(settings):
            layout.operator(
                operators.VIRTUAL_APERTURE_OT_solve.bl_idname, text="Solve Again", icon="FILE_REFRESH"
            ).again = True
        if settings.points is not None:
            _draw_solve(layout, context)


def _draw_solve(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """What the solve found, what would help it, and what it hid."""
    settings = context.scene.virtual_aperture
    box = layout.box()
    if settings.summary:
        wrapped(box, context, settings.summary, icon="CHECKMARK")
        if settings.advice:
            wrapped(box, context, f"Advice: {settings.advice}", icon="INFO")
    else:
        box.label(text="Solved", icon="CHECKMARK")
    depth_ahead.draw(box, settings)
    if (found := depth_ahead.of(settings)) is not None and found.problem:
        wrapped(box, context, f"Depth was not found: {found.problem}", icon="ERROR")
    elif found is not None and found.warning and not len(settings.subjects.items):
        wrapped(box, context, found.warning[:1].upper() + found.warning[1:], icon="QUESTION")
        box.operator(VIRTUAL_APERTURE_OT_pick_subject.bl_idname, icon="BRUSH_DATA")
    if names := after_solve.still_hidden(context.scene):
        wrapped(box, context, after_solve.hidden_words(names), icon="HIDE_ON")


class VIRTUAL_APERTURE_PT_depth(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Masks and Depth Maps"
    bl_parent_id = "VIRTUAL_APERTURE_PT_solve"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        layout.prop(settings, "masks")
        layout.prop(settings, "mask")
        if settings.mask is not None and masks.follows_tracks(settings.mask):
            wrapped(layout, context, "Mask points that follow tracks stay in place", icon="INFO")
        layout.prop(settings, "depth_maps")


CLASSES = (VIRTUAL_APERTURE_PT_solve, VIRTUAL_APERTURE_PT_depth)
