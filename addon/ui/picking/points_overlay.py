"""The feature points in the 3D viewport, in their own colours, where Show Points asks for them.

Blender draws vertices without edges black, or orange where the object is selected, whatever their colours.
They are drawn here over those, which still answer clicks.
"""

from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from ...core.base.arrays import Floats
from ...scene.lens.lens import focus_of_settings
from ...scene.solve import point_cloud
from ...scene.solve.point_cloud import ID_ATTRIBUTE
from ...scene.sources.shot import IDENTITY

SIZE, RIM_SIZE = 4.0, 6.0
"""Pixels across, at a resolution scale of 1: no less than the points that Blender draws without colours."""
PICKED_SIZE, PICKED_RIM_SIZE = 9.0, 12.0
PICKED_COLOUR, RIM_COLOUR = (0.25, 1.0, 0.35, 1.0), (0.0, 0.0, 0.0, 1.0)
NEARER = 1e-4
"""Share of the depth range by which points are drawn nearer to the viewer, as Blender draws its own."""
_batches: dict[tuple[object, ...], tuple[Any, Any]] = {}
"""The batch of all points, and that of the picked ones or None, by mesh and picks."""


def places_and_colours(mesh: bpy.types.Mesh) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return (n, 3) vertices and (n, 4) their colours, display encoded; white where they have none."""
    count = len(mesh.vertices)
    places, colours = np.zeros((count, 3), np.float32), np.ones((count, 4), np.float32)
    mesh.vertices.foreach_get("co", places.ravel())
    colour = mesh.color_attributes.get("colour")
    if colour is not None and len(colour.data) == count:
        colour.data.foreach_get("color_srgb", colours.ravel())
    return places, colours


def picked_vertices(mesh: bpy.types.Mesh, points: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return (n,) which vertices are the points with these IDs."""
    ids = np.arange(len(mesh.vertices), dtype=np.int32)
    attribute = mesh.attributes.get(ID_ATTRIBUTE)
    if attribute is not None and len(attribute.data) == len(ids):
        attribute.data.foreach_get("value", ids)
    return np.isin(ids, points)


def is_shown(context: bpy.types.Context) -> bool:
    """Return whether the point cloud is drawn in this viewport."""
    points, space = context.scene.virtual_aperture.points, context.space_data
    if points is None or points.type != "MESH" or not space.overlay.show_overlays:
        return False
    # In Edit Mode Blender draws the vertices itself.
    if points.mode == "EDIT" or not point_cloud.is_shown(points):
        return False
    return bool(points.visible_get(view_layer=context.view_layer, viewport=space))


def draw() -> None:
    """Draw the points of the scene."""
    context = bpy.context
    if not is_shown(context):
        # Edits of the mesh are not reported: it is drawn anew afterwards.
        _batches.clear()
        return
    points = context.scene.virtual_aperture.points
    everything, picked = _made(context.scene.virtual_aperture)
    scale = context.preferences.system.ui_scale
    selected = (*context.preferences.themes[0].view_3d.object_active, 1.0)
    projection = gpu.matrix.get_projection_matrix()
    projection[2] -= NEARER * projection[3]
    gpu.state.depth_test_set("LESS_EQUAL")
    # A near point's rim covers the far points behind it.
    gpu.state.depth_mask_set(True)
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_projection_matrix(projection)
        gpu.matrix.multiply_matrix(points.matrix_world)
        _draw_points(everything, RIM_SIZE * scale, selected if points.select_get() else RIM_COLOUR)
        _draw_points(everything, SIZE * scale)
        if picked is not None:
            _draw_points(picked, PICKED_RIM_SIZE * scale, RIM_COLOUR)
            _draw_points(picked, PICKED_SIZE * scale, PICKED_COLOUR)
    gpu.state.point_size_set(1.0)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


def _draw_points(batch: Any, size: float, colour: tuple[float, ...] | None = None) -> None:
    """Squares of `size` pixels, in their own colours where none is given."""
    shader = gpu.shader.from_builtin("POINT_FLAT_COLOR" if colour is None else "POINT_UNIFORM_COLOR")
    shader.bind()
    if colour is not None:
        shader.uniform_float("color", colour)
    gpu.state.point_size_set(size)
    batch.draw(shader)


def _made(settings: Any) -> tuple[Any, Any]:
    """The batches, made anew where the mesh or what is picked in it has changed."""
    mesh = settings.points.data
    chosen = focus_of_settings(settings).points
    key = (mesh.session_uid, str(mesh.get(IDENTITY)), len(mesh.vertices), chosen)
    if key not in _batches:
        places, colours = places_and_colours(mesh)
        here = places[picked_vertices(mesh, chosen)]
        _batches.clear()
        _batches[key] = _batch(places, colours), _batch(here) if len(here) else None
    return _batches[key]


def _batch(places: Floats | NDArray[np.float32], colours: NDArray[np.float32] | None = None) -> Any:
    # The shader of one colour for all leaves the points' own aside.
    name = "POINT_UNIFORM_COLOR" if colours is None else "POINT_FLAT_COLOR"
    content = {"pos": places} if colours is None else {"pos": places, "color": colours}
    return batch_for_shader(gpu.shader.from_builtin(name), "POINTS", content)
