"""The Lens panel: presets, scale, the shape of the aperture, and clipped highlights."""

import bpy

from ...core.base.errors import UserError
from ...scene.lens import depth_of_field, scale
from ..base.operators import sentence
from ..base.text import wrapped
from ..focus import bokeh, lens_amount, lens_presets
from .main import draw_subject
from .panel import ClosedPanel, split

LESS_LIGHT = 1.02
"""T-stop over f-stop from which it is shown: a twentieth of a stop."""
BOKEH = 5.0
"""Rows that the picture of the aperture is high. Chosen by inspection."""


class VIRTUAL_APERTURE_PT_lens(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Lens"

    def draw_header_preset(self, _context: bpy.types.Context) -> None:
        lens_presets.VIRTUAL_APERTURE_PT_lens_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        kind = lens_amount.stored_by(settings)
        lens_amount.draw_kinds(layout, kind)
        # The percentage in the first panel cannot have keys.
        layout.prop(settings, "blur" if kind == "BLUR" else lens_amount.FIELDS[kind])
        self.layout.operator("virtual_aperture.add_lens_camera", icon="CAMERA_DATA")


def draw_bokeh(
    layout: bpy.types.UILayout, context: bpy.types.Context, shape: bpy.types.PropertyGroup
) -> None:
    """Draw a point of light out of focus with an aperture shape, or the reason why there is no picture.

    Where the shape takes light and the scale is known, its T-stop is drawn, too.
    """
    settings = context.scene.virtual_aperture
    try:
        if picture := bokeh.icon(shape.aperture):
            layout.template_icon(icon_value=picture, scale=BOKEH)
        f_stop, t_stop = depth_of_field.f_stop(settings), depth_of_field.t_stop(settings)
        if scale.known_scale(settings) > 0 and t_stop > LESS_LIGHT * f_stop:
            wrapped(layout, context, f"f/{f_stop:.1f}, T{t_stop:.1f} without losses in glass")
    except UserError as error:
        wrapped(layout, context, sentence(str(error)), icon="ERROR", alert=True)


class VIRTUAL_APERTURE_PT_scale(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Scale"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        draw_subject(layout, settings)
        layout.prop(settings, "metres_per_unit")
        if settings.points is not None:
            millimetres = 1000 * depth_of_field.focal_metres(settings)
            sensor = scale.sensor_millimetres(settings)
            if settings.lens != "SENSOR":
                layout.prop(settings, "f_stop_format")
            crop = scale.width(scale.FULL_FRAME) / sensor
            meant = f" (crop factor {crop:.2f})" if crop != 1 else " (full-frame equivalent)"
            if settings.lens == "SENSOR" and crop == 1:
                meant = ""
            wrapped(layout, context, f"{millimetres:.1f} mm lens, {sensor:g} mm sensor{meant}")


class VIRTUAL_APERTURE_PT_shape(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Aperture Shape"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

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
        # Whole names are cut off in a sidebar of the default width.
        short = {"ratio": "Squeeze", "spherical_aberration": "Aberration", "vignetting": "Cat's-Eye"}
        for name in (
            "ratio", "obstruction", "apodisation", "spherical_aberration", "vignetting", "axial_colour",
            "image",
        ):  # fmt: skip
            layout.prop(shape, name, text=short.get(name))


class VIRTUAL_APERTURE_PT_aberrations(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Aberrations"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

    def draw(self, context: bpy.types.Context) -> None:
        shape = context.scene.virtual_aperture.shape
        layout = split(self.layout, with_keys=True)
        # Whole names are cut off in a sidebar of the default width.
        short = {"anamorphic_focus": "Anamorphic", "matte_box_sides": "Matte Box", "matte_box_top": "Top"}
        for name in (
            "breathing", "swirl", "field_curvature", "coma", "anamorphic_focus", "lateral_colour",
            "matte_box_sides", "matte_box_top",
        ):  # fmt: skip
            layout.prop(shape, name, text=short.get(name))


class VIRTUAL_APERTURE_PT_highlights(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Highlights"
    bl_parent_id = "VIRTUAL_APERTURE_PT_lens"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout, with_keys=True)
        layout.prop(settings, "restore_highlights")
        column = layout.column(align=True)
        column.active = settings.restore_highlights
        column.prop(settings, "highlight_boost", text="Boost")
        column.prop(settings, "highlight_threshold")
