"""Our objects in a scene: which are missing because the user deleted them, and which other scenes share."""

import bpy

from .sources.shot import IDENTITY

PARTS = {"root": "root", "camera": "camera", "points": "point cloud", "aperture": "virtual cameras"}
"""Properties of the settings that point to objects, and their names for the user."""


def is_in(scene: bpy.types.Scene, thing: bpy.types.Object | None) -> bool:
    """Return whether an object is in a scene: a deleted one exists while a property points to it."""
    if thing is None:
        return False
    found = scene.objects.get(thing.name)
    # Linked objects may have the names of others.
    return found == thing or (found is not None and thing in scene.objects.values())


def missing(scene: bpy.types.Scene) -> list[str]:
    """Return the parts of a solved clip that the scene has lost, in the user's words."""
    settings = scene.virtual_aperture
    if not settings.clip_identity and settings.points is None:
        return []
    return [word for name, word in PARTS.items() if not is_in(scene, getattr(settings, name))]


def leave_shared(scene: bpy.types.Scene) -> None:
    """Forget objects that another scene has, too, or that are linked from a library.

    A new solve would change a linked copy's scene. This scene's objects are then made anew.
    """
    settings = scene.virtual_aperture
    others = [other.virtual_aperture for other in bpy.data.scenes if other != scene]
    ours = {getattr(settings, name) for name in PARTS} - {None}
    theirs = {getattr(other, name) for other in others for name in PARTS}
    if not ours & theirs and all(thing.library is None for thing in ours):
        return
    for name in PARTS:
        setattr(settings, name, None)
    for child in [child for child in scene.collection.children if child.get(IDENTITY)]:
        scene.collection.children.unlink(child)
