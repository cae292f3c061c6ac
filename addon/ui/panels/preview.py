"""The Preview panel: settings of viewports in Rendered shading."""

from __future__ import annotations

import bpy

from . import live_preview
from .panel import ClosedPanel, split


class VIRTUAL_APERTURE_PT_preview(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Preview"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        column = layout.column()
        column.active = live_preview.is_shown(context)
        column.prop(settings, "viewport_shows")
        column.prop(settings, "viewport_wipe")
        row = layout.row()
        row.active = settings.points is not None
        row.prop(settings, "show_points")
