"""Blender's own panels in the Properties editor, joined by our engine.

A panel of Blender's shows with the engines that its set `COMPAT_ENGINES` names, and other engines add
themselves. Without, the Properties editor would have no output path, format, frame range or colour
management.
"""

import bpy

from ...render.engine import VirtualApertureEngine

COMMON = "BLENDER_RENDER"
"""No engine any more: Blender keeps it as the mark of panels that any engine has a use for."""
TABS = (
    "bl_ui.properties_output",
    "bl_ui.properties_render",
    "bl_ui.properties_view_layer",
    "bl_ui.properties_object",
    "bl_ui.properties_data_camera",
    "bl_ui.properties_data_mesh",
    # Panels of CG objects, which Cycles draws.
    "bl_ui.properties_data_curves",
    "bl_ui.properties_data_light",
    "bl_ui.properties_data_pointcloud",
    "bl_ui.properties_data_volume",
    "bl_ui.properties_material",
    "bl_ui.properties_particle",
    "bl_ui.properties_world",
    # Heard in movies whichever engine draws them.
    "bl_ui.properties_data_speaker",
)
"""Modules of Blender's interface whose panels apply to our renders, our camera and points, or CG objects; and
those that begin as `PHYSICS`. Freestyle, which has no effect, is left out."""
PHYSICS = "bl_ui.properties_physics_"
IGNORED = (
    "DATA_PT_camera_stereoscopy",
    # A ball in the light, which our engine does not draw.
    "DATA_PT_preview",
    # The panel of EEVEE shows the same.
    "DATA_PT_light",
    "NODE_DATA_PT_light",
    "RENDER_PT_gpencil",
    "RENDER_PT_grease_pencil_",
    # One eye only: Render Multiview does nothing.
    "RENDER_PT_output_views",
    "RENDER_PT_stereoscopy",
    # The clip's frame is the scene's frame, not the remapped one.
    "RENDER_PT_time_stretching",
)
"""Beginnings of the names of panels in `TABS` that would promise what our engine ignores."""
MORE = (
    # The compositor's device is common to all engines and has no panel; its parent is included.
    "RENDER_PT_eevee_performance",
    "RENDER_PT_eevee_performance_compositor",
    "RENDER_PT_eevee_performance_compositor_denoise_settings",
    # Material, light and world by their nodes, as Cycles has them, too: its own panels show with it alone.
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_MATERIAL_PT_volume",
    "EEVEE_MATERIAL_PT_displacement",
    "DATA_PT_EEVEE_light",
    "EEVEE_WORLD_PT_surface",
)
"""Panels without the common mark that apply to our renders."""
_joined: list[type[bpy.types.Panel]] = []


def panels() -> list[type[bpy.types.Panel]]:
    """Return Blender's panels that apply to our engine."""
    return [
        panel for panel in bpy.types.Panel.__subclasses__()
        if (panel.__module__ in TABS or panel.__module__.startswith(PHYSICS))
        and not panel.__name__.startswith(IGNORED)
        and (COMMON in getattr(panel, "COMPAT_ENGINES", ()) or panel.__name__ in MORE)
    ]  # fmt: skip


def register() -> None:
    """Add our engine to Blender's panels."""
    for panel in panels():
        if VirtualApertureEngine.bl_idname not in panel.COMPAT_ENGINES:
            panel.COMPAT_ENGINES.add(VirtualApertureEngine.bl_idname)
            _joined.append(panel)


def unregister() -> None:
    """Take our engine out of the panels that it was added to."""
    while _joined:
        _joined.pop().COMPAT_ENGINES.discard(VirtualApertureEngine.bl_idname)
