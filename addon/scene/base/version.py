"""The version of the settings that a scene holds."""

import bpy

from ...core.base.errors import UserError

VERSION = 5
"""To be raised where a release reads a scene in another way than the one before it."""
NEWER = "this scene was made with a newer Virtual Aperture; update the extension"


def is_newer(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether a newer version made the scene, so that its settings may mean something else."""
    return bool(settings.version > VERSION)


def check(settings: bpy.types.PropertyGroup) -> None:
    """Refuse a scene that a newer version made, by a UserError."""
    if is_newer(settings):
        raise UserError(NEWER)
