"""Sub-panels of the lens: the shape of its aperture, and the light of what is clipped."""

from __future__ import annotations

import bpy

from .panel import ClosedPanel


class VIRTUAL_APERTURE_PT_shape(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Aperture Shape"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        shape = context.scene.virtual_aperture.shape
        layout = self.layout
        layout.use_property_split = True
        column = layout.column()
        column.active = not shape.image
        column.prop(shape, "blades")
        row = column.column()
        row.active = shape.blades >= 3
        row.prop(shape, "rotation")
        row.prop(shape, "roundness")
        for name in ("ratio", "obstruction", "apodisation", "spherical_aberration", "vignetting", "image"):
            layout.prop(shape, name)


class VIRTUAL_APERTURE_PT_highlights(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Highlights"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = self.layout
        layout.use_property_split = True
        column = layout.column(align=True)
        column.prop(settings, "highlights")
        row = column.row()
        row.active = settings.highlights > 0
        row.prop(settings, "highlight_threshold")


CLASSES = (VIRTUAL_APERTURE_PT_shape, VIRTUAL_APERTURE_PT_highlights)
