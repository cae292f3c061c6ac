"""The lens: how much blur, scale and f-stop, the shape of the aperture, and the light of what is clipped."""

from __future__ import annotations

import bpy

from ...core.base.errors import UserError
from ...scene import depth_of_field, lens
from .. import bokeh, set_scale
from ..operators import sentence
from ..text import wrapped
from .panel import ClosedPanel, split

PROPERTY_NAME = 0.4
"""Share of a panel's width that the names of properties have, as Blender splits it."""
BOKEH = 5.0
"""Rows that the picture of the aperture is high. By eye."""


def draw_amount(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """How much blur, as a share of the width, an f-stop and a radius; and what is sharp with it."""
    layout.prop(settings, "blur")
    column = layout.column()
    column.active = not lens.is_keyed(settings, "blur")
    if settings.metres_per_unit > 0:
        column.prop(settings, "f_stop")
    elif settings.points is not None:
        split = column.split(factor=PROPERTY_NAME)
        name = split.row()
        name.alignment = "RIGHT"
        name.label(text="F-Stop")
        split.operator(set_scale.VIRTUAL_APERTURE_OT_set_scale.bl_idname, text="Set Scale")
    column.prop(settings, "aperture_radius", text="Aperture")
    if sharp := depth_of_field.sharp_words(settings):
        layout.label(text=sharp, icon="CAMERA_DATA")


def draw_bokeh(
    layout: bpy.types.UILayout, context: bpy.types.Context, shape: bpy.types.PropertyGroup
) -> None:
    """What a point of light out of focus looks like with a shape, or why there is no such picture."""
    try:
        if picture := bokeh.icon(shape.aperture):
            layout.template_icon(icon_value=picture, scale=BOKEH)
    except UserError as error:
        wrapped(layout, context, sentence(str(error)), icon="ERROR", alert=True)


class VIRTUAL_APERTURE_PT_scale(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Scale and F-Stop"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        if not settings.metres_per_unit:
            wrapped(
                layout,
                context,
                "F-stops need the scene's scale: set the distance between two vertices",
                icon="INFO",
            )
        layout.operator(set_scale.VIRTUAL_APERTURE_OT_set_scale.bl_idname, icon="DRIVER_DISTANCE")
        layout.prop(settings, "metres_per_unit")
        if settings.metres_per_unit > 0:
            millimetres = 1000 * depth_of_field.focal_metres(settings)
            sensor = depth_of_field.sensor_millimetres(settings)
            equivalent = "" if settings.lens == "SENSOR" else " (full-frame equivalent)"
            wrapped(layout, context, f"{millimetres:.1f} mm lens, {sensor:g} mm sensor{equivalent}")


class VIRTUAL_APERTURE_PT_shape(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Aperture Shape"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        shape = context.scene.virtual_aperture.shape
        layout = split(self.layout, with_keys=True)
        draw_bokeh(layout, context, shape)
        column = layout.column()
        column.active = not shape.image
        column.prop(shape, "blades")
        row = column.column()
        row.active = shape.blades >= 3
        row.prop(shape, "rotation")
        row.prop(shape, "roundness")
        for name in ("ratio", "obstruction", "apodisation"):
            layout.prop(shape, name)
        # Its whole name is cut off in a sidebar of the default width.
        layout.prop(shape, "spherical_aberration", text="Aberration")
        for name in ("vignetting", "image"):
            layout.prop(shape, name)


class VIRTUAL_APERTURE_PT_highlights(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Highlights"
    bl_parent_id = "VIRTUAL_APERTURE_PT_focus"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        column = layout.column(align=True)
        column.prop(settings, "highlights")
        row = column.row()
        row.active = settings.highlights > 0
        row.prop(settings, "highlight_threshold")


CLASSES = (VIRTUAL_APERTURE_PT_scale, VIRTUAL_APERTURE_PT_shape, VIRTUAL_APERTURE_PT_highlights)
