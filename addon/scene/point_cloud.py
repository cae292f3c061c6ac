"""The feature points as a mesh whose vertices can be picked."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.camera.reconstruction import Reconstruction

ID_ATTRIBUTE = "point"
"""Vertex attribute with the point's ID: vertices may be deleted, IDs stay."""


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
