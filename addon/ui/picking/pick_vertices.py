"""Operators of the focus: from vertices, and the list of focus marks."""

from collections.abc import Sequence

import bmesh
import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.focus.focus import Focus
from ...core.focus.place import Place
from ...scene.base.timeline import clip_frame
from ...scene.focus import focus_marks
from ...scene.lens import blender_focus, lens
from ...scene.lens.depth_of_field import length_words
from ...scene.solve.point_cloud import ID_ATTRIBUTE
from ...scene.sources import subjects
from ...scene.sources.shot import reconstruction_of
from ..base.operators import Edits, has_points, polls

ADD_MARK = bpy.props.BoolProperty(
    name="Add Mark",
    description="Add a second focus mark at the current frame instead of replacing the first, so that focus"
    " is pulled to it",
    options={"SKIP_SAVE"},
)
"""Property of operators that call `focus_on`."""


def focus_on(
    settings: bpy.types.PropertyGroup, frame: int, places: Sequence[Place], add: bool = False
) -> str:
    """Put places in focus at a frame, as `focus_marks.put`; returns a line about it.

    If the focus distance has keys of the user's, the pick is the next of them.
    """
    marked = subjects.mark_new(settings, places)
    released = blender_focus.release(settings)
    after = f"; {released} is no longer the focus object" if released else ""
    if focus_marks.are_keys_users(settings):
        now = clip_frame(settings.id_data)
        settings.focus_distance = 1 / float(np.mean([1 / place.distance for place in places]))
        settings.id_data.keyframe_insert(settings.path_from_id("focus_distance"), frame=now)
        keyed = f"he focus distance is keyed at frame {now}"
        said = f"{marked}; t{keyed}" if marked else f"T{keyed}"
    else:
        mark = focus_marks.put(settings, frame, places, add)
        away = length_words(settings, mark.distance)
        marks = len(settings.marks.items)
        pulled = f", mark {settings.marks.active + 1} of {marks}" if marks > 1 else ""
        what = (
            f"{marked} and in focus at frame {frame}:"
            if marked
            else f"In focus at frame {frame}: {mark.name},"
        )
        said = f"{what} {away} away{pulled}"
    guessed = "; the distance is estimated" if any(place.is_estimated for place in places) else ""
    return said + guessed + after


class VIRTUAL_APERTURE_OT_set_focus(Edits, bpy.types.Operator):  # noqa: N801
    """Focus on the selected vertices of the point cloud: at least one, ideally four"""

    bl_label = "Set Focus from Selected Vertices"

    poll = polls(has_points)

    def act(self, context: bpy.types.Context) -> str:
        settings = context.scene.virtual_aperture
        ids = selected_points(settings.points)
        if not ids:
            raise UserError("no vertices are selected; select some on what should be sharp, ideally four")
        reconstruction = reconstruction_of(settings)
        if len(ids) == len(reconstruction.points):
            raise UserError(
                f"all {len(ids)} vertices are selected; press Alt A to deselect all, then select some on"
                " what should be sharp"
            )
        own = lens.focus_of_settings(settings)
        focus = Focus(tuple(ids), through_points=own.through_points)
        image, _ = reconstruction.image_at(clip_frame(context.scene))
        frame = image.frame
        # Not all selections have a plane through them.
        focus.lens(reconstruction, frame, reconstruction.intrinsics(image).without_distortion(), 1.0)
        distance = 1 / focus.inverse_depth(reconstruction, frame)
        # In Edit Mode only the mesh can be undone, and the points' colours are hidden.
        bpy.ops.object.mode_set(mode="OBJECT")
        place = Place(focus, frame, distance, "selected vertices")
        return focus_on(settings, frame, [place])


def selected_points(points: bpy.types.Object) -> list[int]:
    """Return the IDs of the vertices that are selected in Edit Mode."""
    vertices = bmesh.from_edit_mesh(points.data).verts
    # Attribute arrays are empty while a mesh is edited: the IDs are in the edit mesh's own layer.
    layer = vertices.layers.int[ID_ATTRIBUTE]
    return [vertex[layer] for vertex in vertices if vertex.select]
