"""Blender's own panels with our engine."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

import addon

NEEDED = (
    "RENDER_PT_format",
    "RENDER_PT_frame_range",
    "RENDER_PT_output",
    "RENDER_PT_output_color_management",
    "RENDER_PT_encoding",
    "RENDER_PT_encoding_video",
    "RENDER_PT_encoding_audio",
    "RENDER_PT_post_processing",
    "RENDER_PT_stamp",
    "RENDER_PT_color_management",
    "RENDER_PT_eevee_performance_compositor",
    "VIEWLAYER_PT_layer",
    "OBJECT_PT_visibility",
    "DATA_PT_context_camera",
    "DATA_PT_lens",
    "DATA_PT_camera_background_image",
    "DATA_PT_camera_display",
    "DATA_PT_context_mesh",
    "DATA_PT_mesh_attributes",
    "DATA_PT_EEVEE_light",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "WORLD_PT_context_world",
)
PROMISES = (
    "RENDER_PT_stereoscopy",
    "RENDER_PT_freestyle",
    "RENDER_PT_gpencil",
    "RENDER_PT_eevee_motion_blur",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_stereoscopy",
    "DATA_PT_light",
    "VIEWLAYER_PT_layer_passes",
)


def seen(name: str, scene: bpy.types.Scene, **more: object) -> bool:
    """Whether Blender's panel shows; its poll asks for the engine, the scene and the data that is edited."""
    if scene.render.image_settings.media_type == "IMAGE" and name.startswith("RENDER_PT_encoding"):
        scene.render.image_settings.media_type = "VIDEO"
    context = SimpleNamespace(engine=scene.render.engine, scene=scene, object=None, camera=None, mesh=None)
    context.__dict__.update(more, space_data=SimpleNamespace(context="DATA"), view_layer=scene.view_layers[0])
    return bool(getattr(bpy.types, name).poll(context))


def everybody() -> dict[str, frozenset[str]]:
    return {
        panel.__name__: frozenset(panel.COMPAT_ENGINES)
        for panel in bpy.types.Panel.__subclasses__()
        if hasattr(panel, "COMPAT_ENGINES")
    }


@pytest.fixture
def data(scene: bpy.types.Scene) -> dict[str, object]:
    camera, mesh = bpy.data.cameras.new("c"), bpy.data.meshes.new("m")
    return {
        "camera": camera, "mesh": mesh, "object": bpy.data.objects.new("o", mesh),
        "light": bpy.data.lights.new("l", "POINT"), "world": bpy.data.worlds.new("w"),
        "material": bpy.data.materials.new("m"),
    }  # fmt: skip


@pytest.mark.parametrize("name", NEEDED)
def test_a_panel_that_renders_need_shows(name: str, scene: bpy.types.Scene, data: dict[str, object]) -> None:
    scene.render.engine = "VIRTUAL_APERTURE"
    assert seen(name, scene, **data)


@pytest.mark.parametrize("name", PROMISES)
def test_a_panel_of_what_is_ignored_does_not_show(
    name: str, scene: bpy.types.Scene, data: dict[str, object]
) -> None:
    scene.render.engine = "VIRTUAL_APERTURE"
    assert not seen(name, scene, **data)


def test_leaving_leaves_the_panels_as_they_were(registered: None) -> None:
    with_us = everybody()
    addon.unregister()
    try:
        without = everybody()
        assert not any("VIRTUAL_APERTURE" in engines for engines in without.values())
        assert any("VIRTUAL_APERTURE" in engines for engines in with_us.values())
        assert without == {name: engines - {"VIRTUAL_APERTURE"} for name, engines in with_us.items()}
    finally:
        addon.register()
    assert everybody() == with_us
