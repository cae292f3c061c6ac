"""CG objects in the clip: Cycles draws them, and our views blur them with it."""

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


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius = DISTANCE, 0.2
    settings.method, settings.views = "features", 16
    scene.cycles.samples = 8
    scene.frame_set(2)
    return scene


def test_in_focus_it_is_sharp_and_hides_the_clip(solved: bpy.types.Scene, tmp_path: Path) -> None:
    plain = rendered(solved, tmp_path / "plain.exr")
    place_lamp(solved, 4.0, 20)
    # Half as far as what is in focus, its disc is 2 R f (1 / 4 - 1 / 8) = 7 pixels across.
    both = rendered(solved, tmp_path / "both.exr")
    assert np.allclose(both[42:48, 77:83, :3], LIGHT, rtol=0.02)
    assert np.allclose(both[:, :40], plain[:, :40], atol=1e-4)


def place_lamp(scene: bpy.types.Scene, distance: float, side: float) -> None:
    """A square of so many pixels that shines, at a distance before the middle of the camera."""
    half = side / 2 * distance / LENS.fx
    corners = [(x * half, y * half, -distance) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
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


def rendered(scene: bpy.types.Scene, file: Path) -> np.ndarray:
    """(H, W, 4) linear light."""
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read(file)
