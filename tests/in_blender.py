"""What a user does in Blender before a button is pressed, and CG objects: squares that shine."""

from __future__ import annotations

from pathlib import Path

import bpy
from mathutils import Vector

from .foreign_models import write_clip

LIGHT = 5.0
"""Radiance of a lamp, where the clip's white is 1."""


def select(points: bpy.types.Object, ids: tuple[int, ...]) -> None:
    """Be in Edit Mode of the point cloud with these vertices selected."""
    import bmesh  # the module's own, there only after bpy

    bpy.context.view_layer.objects.active = points
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    mesh = bmesh.from_edit_mesh(points.data)
    mesh.verts.ensure_lookup_table()
    for index in ids:
        mesh.verts[index].select_set(True)
    bmesh.update_edit_mesh(points.data)


def choose_clip(scene: bpy.types.Scene, folder: Path) -> Path:
    """The clip of the foreign models, chosen in the panel; its working folder."""
    settings = scene.virtual_aperture
    settings.footage = str(write_clip(folder / "clip"))
    settings.work_dir = str(folder / "work")
    return folder / "work"


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
