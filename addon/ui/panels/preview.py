"""The Preview panel: what a viewport in Rendered shading shows."""

from __future__ import annotations

import bpy

from .. import preview
from .panel import Panel, split


class VIRTUAL_APERTURE_PT_preview(Panel, bpy.types.Panel):  # noqa: N801
    bl_label = "Preview"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        is_shown = preview.is_shown(context)
        layout.operator(
            preview.VIRTUAL_APERTURE_OT_preview.bl_idname,
            text="End Preview" if is_shown else "Preview",
            icon="SHADING_RENDERED",
            depress=is_shown,
        )
        column = layout.column()
        column.active = is_shown
        column.prop(settings, "viewport_shows")
        column.prop(settings, "viewport_wipe")
        row = layout.row()
        row.active = settings.points is not None
        row.prop(settings, "show_points")


CLASSES = (VIRTUAL_APERTURE_PT_preview,)
