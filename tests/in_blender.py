"""What a user does in Blender before a button is pressed."""

from __future__ import annotations

from pathlib import Path

import bpy

from .foreign_models import write_clip


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
