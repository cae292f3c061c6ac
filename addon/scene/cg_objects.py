"""Which objects of a scene are CG objects, drawn into the clip, and how they are split in layers."""

from collections.abc import Sequence

import bpy
import numpy as np
from bpy.props import BoolProperty

from ..core.base.arrays import Floats

GEOMETRY = {
    "MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL",
}  # fmt: skip
"""Types of objects that Cycles draws. Lights alone are seen by nobody."""
SKY = {"TEX_ENVIRONMENT", "TEX_SKY"}
"""Types of a world's nodes with light from somewhere, and so shadows."""
STAYS_SHARP = "virtual_aperture_stays_sharp"
"""Property of objects that no lens blurs,"""
STAYS_SHARP_SWITCH = BoolProperty(
    name="Stays Sharp",
    description="No lens blurs this object, as a title: nearer surfaces of the clip still hide it, softly"
    " where they are out of focus",
    options=set(),
)
"""and its declaration."""
MOST_LAYERS = 6
"""Layers of CG objects; each is a separate render."""


def cg_objects(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Return the objects of a view layer that are drawn into the clip.

    These are the objects that Cycles would show to the camera, without those that a solve hid because the
    camera goes through them, for as long as they are hidden.
    """
    settings = scene.virtual_aperture
    ours = settings.points, settings.aperture
    blocking = {entry.thing for entry in settings.hidden}
    # An object that was just removed from the file leaves None.
    there = [thing for thing in layer.objects if thing is not None and thing not in ours]
    there = [thing for thing in there if thing not in blocking or not thing.hide_get(view_layer=layer)]
    return [thing for thing in there if _is_geometry(thing) and thing.visible_camera and is_rendered(thing)]


def _is_geometry(thing: bpy.types.Object) -> bool:
    return thing.type in GEOMETRY or (thing.type == "EMPTY" and thing.instance_type == "COLLECTION")


def is_rendered(thing: bpy.types.Object) -> bool:
    """Return whether neither an object nor all of its collections are disabled in renders."""
    return not thing.hide_render and any(not each.hide_render for each in thing.users_collection)


def has_shadows(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> bool:
    """Return whether there is a light that can cast shadows."""
    lamps = [thing for thing in layer.objects if thing is not None and thing.type == "LIGHT"]
    world = scene.world
    nodes = world.node_tree.nodes if world is not None and world.node_tree is not None else ()
    return any(map(is_rendered, lamps)) or any(node.type in SKY for node in nodes)


def stays_sharp(thing: bpy.types.Object) -> bool:
    """Return whether an object stays sharp at any distance."""
    return bool(getattr(thing, STAYS_SHARP))


def split_by_depth(
    things: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph, to_camera: Floats
) -> list[tuple[list[bpy.types.Object], float]]:
    """Divide CG objects into groups apart in depth, near ones first, with the inverse depth of their middles.

    Parts of a group hidden by another one are drawn, so that they are visible past its silhouettes. Objects
    that overlap in depth may touch: they stay together, as do those that other objects instance.

    Args:
        things: The objects.
        depsgraph: The evaluated scene.
        to_camera: (4, 4) from the world to a camera that looks along -z.
    """
    spans = sorted((*_inverse_depths(thing, depsgraph, to_camera), n) for n, thing in enumerate(things))
    groups: list[tuple[float, float, list[int]]] = []
    for low, high, number in spans:
        if groups and low <= groups[-1][1]:
            first, last, members = groups[-1]
            groups[-1] = first, max(last, high), [*members, number]
        else:
            groups.append((low, high, [number]))
    while len(groups) > MOST_LAYERS:
        gaps = [groups[n + 1][0] - groups[n][1] for n in range(len(groups) - 1)]
        n = int(np.argmin(gaps))
        both = groups[n][0], groups[n + 1][1], groups[n][2] + groups[n + 1][2]
        groups[n : n + 2] = [both]
    return [([things[n] for n in members], (low + high) / 2) for low, high, members in reversed(groups)]


def _inverse_depths(
    thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, to_camera: Floats
) -> tuple[float, float]:
    """Least and largest inverse depth of an object's bounding box before the camera."""
    if thing.type == "EMPTY" or thing.is_instancer or thing.particle_systems:
        # Its box does not contain its instances.
        return 0.0, np.inf
    evaluated = thing.evaluated_get(depsgraph)
    corners = np.column_stack([np.array(evaluated.bound_box), np.ones(8)])
    depth = -(to_camera @ np.array(evaluated.matrix_world) @ corners.T)[2]
    nearest, farthest = float(depth.min()), float(depth.max())
    return (1 / farthest if farthest > 0 else 0.0), (1 / nearest if nearest > 0 else np.inf)
