"""The feature points as a mesh whose vertices can be picked."""

import bpy
import numpy as np

from ...core.camera.reconstruction import Reconstruction

ID_ATTRIBUTE = "point"
"""Vertex attribute with the point's ID: vertices may be deleted, IDs stay."""
HIDDEN = "Hidden"
"""Name of the modifier that leaves no vertex to draw outside of Edit Mode, and of its empty vertex group."""


def is_shown(thing: bpy.types.Object) -> bool:
    """Return whether the point cloud's vertices are drawn in Object Mode."""
    modifier = thing.modifiers.get(HIDDEN)
    return modifier is None or not modifier.show_viewport


def show(thing: bpy.types.Object, shown: bool) -> None:
    """Have the vertices drawn in Object Mode, or not."""
    make_hidden(thing)
    thing.modifiers[HIDDEN].show_viewport = not shown


def make_hidden(thing: bpy.types.Object) -> None:
    """Hide the vertices in Object Mode, unless `show` has shown them: they would cover the clip.

    The object stays visible, because Tab edits no hidden one, and in Edit Mode all vertices are there.
    """
    # The mesh keeps the groups, and loses them when it is filled anew.
    if HIDDEN not in thing.vertex_groups:
        thing.vertex_groups.new(name=HIDDEN)
    if HIDDEN not in thing.modifiers:
        thing.modifiers.new(HIDDEN, "MASK").vertex_group = HIDDEN


def fill(mesh: bpy.types.Mesh, reconstruction: Reconstruction) -> None:
    """Vertices with colour, reprojection error and number of frames, none selected; vertex i is point i."""
    points = reconstruction.points
    count = len(points)
    mesh.clear_geometry()
    mesh.vertices.add(count)
    # Else the first Tab would have all of them selected.
    mesh.vertices.foreach_set("select", np.zeros(count, dtype=bool))
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
