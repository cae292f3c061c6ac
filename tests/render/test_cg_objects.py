"""CG objects over the clip, as the page on compositing says: Cycles draws them in a copy of the scene."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

from addon.core.camera.reconstruction import Intrinsics
from addon.scene.build import build
from addon.scene.exr import read

from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
DISTANCE = 8.0
LIGHT = 5.0


def test_a_copy_of_the_scene_draws_them(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius = DISTANCE, 0.2
    settings.method, settings.views = "features", 4
    scene.frame_set(2)
    plain = rendered(scene, tmp_path / "plain.exr")
    bpy.context.window.scene = scene
    bpy.ops.scene.new(type="LINK_COPY")
    copy = bpy.context.window.scene
    assert copy != scene and copy.camera == settings.camera
    copy.render.engine, copy.render.film_transparent, copy.cycles.samples = "CYCLES", True, 16
    copy.camera.data.dof.use_dof = True
    assert copy.camera.data.dof.focus_distance == pytest.approx(DISTANCE)
    place_lamp(copy)
    bpy.context.window.scene = scene
    composite(scene, copy)
    both = rendered(scene, tmp_path / "both.exr")
    # In focus: sharp and bright in the middle, and the clip where it is not.
    assert np.allclose(both[42:48, 77:83, :3], LIGHT, rtol=0.02)
    assert np.allclose(both[:, :40], plain[:, :40], atol=1e-4)


def place_lamp(scene: bpy.types.Scene) -> None:
    """A square of 20 pixels that shines, where focus is, before the middle of the camera."""
    half = 10 * DISTANCE / LENS.fx
    corners = [(x * half, y * half, -DISTANCE) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    to_world = scene.camera.matrix_world.normalized()
    mesh = bpy.data.meshes.new("lamp")
    mesh.from_pydata([to_world @ Vector(corner) for corner in corners], [], [(0, 1, 2, 3)])
    material = bpy.data.materials.new("light")
    nodes = material.node_tree.nodes
    nodes.clear()
    light, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    light.inputs["Strength"].default_value = LIGHT
    material.node_tree.links.new(light.outputs[0], out.inputs[0])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new("lamp", mesh))


def composite(scene: bpy.types.Scene, copy: bpy.types.Scene) -> None:
    """Alpha Over: the clip, and the copy over it."""
    tree = bpy.data.node_groups.new("over", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    clip, objects = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeRLayers")
    clip.scene, objects.scene = scene, copy
    over, out = tree.nodes.new("CompositorNodeAlphaOver"), tree.nodes.new("NodeGroupOutput")
    behind, before = (socket for socket in over.inputs if socket.type == "RGBA")
    tree.links.new(clip.outputs["Image"], behind)
    tree.links.new(objects.outputs["Image"], before)
    tree.links.new(over.outputs[0], out.inputs[0])
    scene.compositing_node_group = tree


def rendered(scene: bpy.types.Scene, file: Path) -> np.ndarray:
    """(H, W, 4) linear light."""
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read(file)
