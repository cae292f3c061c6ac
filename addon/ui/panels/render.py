"""The Preview panel, and the Render panel: frames, output and quality."""

import bpy

from ...core.frame.meshers import MESHERS
from ...scene.cg_objects import STAYS_SHARP, cg_objects
from ..jobs import export, movie
from . import live_preview
from .panel import ClosedPanel, split


class VIRTUAL_APERTURE_PT_preview(ClosedPanel, bpy.types.Panel):  # noqa: N801
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


class VIRTUAL_APERTURE_PT_render(ClosedPanel, bpy.types.Panel):  # noqa: N801
    def draw(self, context: bpy.types.Context) -> None:
        scene = context.scene
        layout = split(self.layout)
        column = layout.column(align=True)
        column.prop(scene, "frame_start", text="Frame Start")
        column.prop(scene, "frame_end", text="End")
        layout.prop(scene.virtual_aperture, "render_as")
        layout.prop(scene.render, "filepath", text="Output")
        layout.prop(scene.virtual_aperture, "quality")
        layout.prop(scene.virtual_aperture, "stabilize")
        filled = layout.row()
        filled.active = scene.virtual_aperture.stabilize > 0
        filled.prop(scene.virtual_aperture, "fill_border")
        layout.prop(scene.virtual_aperture, "grain")
        export.draw(self.layout, context)


def output_words(scene: bpy.types.Scene) -> str:
    """Return the output of Render Clip in one line."""
    render = scene.render
    count = len(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    which = f"Frames {scene.frame_start} to {scene.frame_end}" if count > 1 else f"Frame {scene.frame_start}"
    if scene.virtual_aperture.render_as == "MOVIE" and scene.virtual_aperture.footage:
        return f"{which}, to {movie.movie_path(scene).name}"
    kind = render.image_settings.bl_rna.properties["file_format"].enum_items[
        render.image_settings.file_format
    ]
    return f"{which}, to {render.filepath or 'the current folder'} as {kind.name}"


class VIRTUAL_APERTURE_PT_passes(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"

    def draw(self, context: bpy.types.Context) -> None:
        layer, layout = context.view_layer, split(self.layout)
        column = layout.column(heading="Sharp Frame")
        column.prop(layer, "use_pass_z", text="Depth")
        column.prop(layer.virtual_aperture_passes, "use_circle_of_confusion")
        column.prop(layer.virtual_aperture_passes, "use_in_focus")
        ours = layer.virtual_aperture_passes
        layout.column(heading="Blurred Frame").prop(ours, "use_range_matte")
        if ours.use_range_matte:
            column = layout.column(align=True)
            for name, text in (("near", "Near"), ("far", "Far"), ("softness", "Softness")):
                column.prop(ours, f"range_{name}", text=text)
            layout.operator("virtual_aperture.add_grade_nodes", icon="NODETREE")


class VIRTUAL_APERTURE_PT_method(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Sampling and Method"
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        layout = split(self.layout)
        layout.prop(settings, "use_auto_views")
        if not settings.use_auto_views:
            layout.prop(settings, "views")
        layout.prop(settings, "method")
        for name in MESHERS[settings.method].settings:
            layout.prop(settings, name)


class VIRTUAL_APERTURE_PT_cg(ClosedPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "CG Objects"
    bl_parent_id = "VIRTUAL_APERTURE_PT_render"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_cycles = super().poll(context) and hasattr(context.scene, "cycles")
        return has_cycles and bool(cg_objects(context.scene, context.view_layer))

    def draw(self, context: bpy.types.Context) -> None:
        layout, cycles, render = split(self.layout), context.scene.cycles, context.scene.render
        if context.object in cg_objects(context.scene, context.view_layer):
            layout.prop(context.object, STAYS_SHARP)
        layout.prop(cycles, "samples", text="Cycles Samples")
        layout.prop(cycles, "use_denoising", text="Denoise")
        layout.prop(render, "use_motion_blur")
        if render.use_motion_blur:
            layout.prop(render, "motion_blur_shutter")
