"""The feature points as a mesh whose vertices can be picked."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.reconstruction import Reconstruction

DOT = 0.035
"""Radius of a drawn point, for a scene whose points are about ten units away."""
ID_ATTRIBUTE = "point"
"""Vertex attribute with the point's ID: vertices may be deleted, IDs stay."""


def fill(mesh: bpy.types.Mesh, reconstruction: Reconstruction) -> None:
    """Vertices with colour, reprojection error and number of frames; vertex i is point i."""
    points = reconstruction.points
    count = len(points)
    mesh.clear_geometry()
    mesh.vertices.add(count)
    mesh.attributes["position"].data.foreach_set("vector", points.xyz.astype(np.float32).ravel())
    colour = np.ones((count, 4), dtype=np.float32)
    colour[:, :3] = points.rgb / 255
    # Byte colours are stored display encoded, as the picture's own pixels are.
    mesh.color_attributes.new("colour", "BYTE_COLOR", "POINT").data.foreach_set("color_srgb", colour.ravel())
    mesh.attributes.new("reprojection_error", "FLOAT", "POINT").data.foreach_set(
        "value", points.error.astype(np.float32)
    )
    mesh.attributes.new("frames", "INT", "POINT").data.foreach_set("value", reconstruction.views_per_point)
    mesh.attributes.new(ID_ATTRIBUTE, "INT", "POINT").data.foreach_set(
        "value", np.arange(count, dtype=np.int32)
    )
    mesh.update()


def show_as_dots(points: bpy.types.Object) -> None:
    """Draw the vertices as coloured dots: a mesh of vertices alone is invisible in Object Mode.

    A Geometry Nodes modifier turns vertices into points for display; picking in Edit Mode sees the
    vertices themselves.
    """
    name = "Virtual Aperture Points"
    tree = bpy.data.node_groups.get(name) or _dots_tree(name)
    modifier = points.modifiers.get(name) or points.modifiers.new(name, "NODES")
    modifier.node_group = tree
    modifier.show_in_editmode = False
    modifier.show_render = False


def _dots_tree(name: str) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    nodes, link = tree.nodes, tree.links.new
    start, end = nodes.new("NodeGroupInput"), nodes.new("NodeGroupOutput")
    dots = nodes.new("GeometryNodeMeshToPoints")
    dots.inputs["Radius"].default_value = DOT
    material = nodes.new("GeometryNodeSetMaterial")
    material.inputs["Material"].default_value = _dots_material(name)
    link(start.outputs[0], dots.inputs["Mesh"])
    link(dots.outputs["Points"], material.inputs["Geometry"])
    link(material.outputs["Geometry"], end.inputs[0])
    for place, node in enumerate((start, dots, material, end)):
        node.location.x = 200 * place
    return tree


def _dots_material(name: str) -> bpy.types.Material:
    material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
    # Solid shading knows materials by this colour only.
    material.diffuse_color = (0.9, 0.6, 0.1, 1.0)
    nodes = material.node_tree.nodes
    nodes.clear()
    colour = nodes.new("ShaderNodeAttribute")
    colour.attribute_name = "colour"
    glow = nodes.new("ShaderNodeEmission")
    out = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(colour.outputs["Color"], glow.inputs["Color"])
    material.node_tree.links.new(glow.outputs[0], out.inputs["Surface"])
    return material
