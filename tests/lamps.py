"""CG objects for tests: squares that shine."""

from __future__ import annotations

import bpy
from mathutils import Vector

LIGHT = 5.0
"""Radiance of a lamp, where the clip's white is 1."""


def place_lamp(
    scene: bpy.types.Scene, distance: float, side: float, across: float = 0.0, down: float = 0.0
) -> bpy.types.Object:
    """A square of so many pixels that shines, at a distance before the camera, `across` times that to its
    right and `down` times that below it."""
    data, render = scene.camera.data, scene.render
    focal = data.lens / data.sensor_width * render.resolution_x
    half, right, up = side / 2 * distance / focal, across * distance, -down * distance
    corners = [(right + x * half, up + y * half, -distance) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
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
    lamp = bpy.data.objects.new("lamp", mesh)
    scene.collection.objects.link(lamp)
    return lamp
