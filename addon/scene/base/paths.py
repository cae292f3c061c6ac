"""Our paths in the .blend: relative to it wherever it is saved, so that its folder can be moved as a whole.

Blender does this for the paths of images and sounds, and not for those of property groups.
"""

import os
from pathlib import Path

import bpy

from .events import at

PATHS = ("footage", "work_dir", "solved_in", "depth_maps", "masks", "segmenter")
"""Properties of the settings that are paths."""
_before: list[tuple[bpy.types.bpy_struct, str, str]] = []
"""Owner, property and value of the paths that were changed for a file that is being written."""


def absolute(path: str, owner: bpy.types.ID | None = None) -> Path:
    """Return a path of the settings with Blender's // resolved; unchanged in an unsaved .blend.

    Args:
        path: The path.
        owner: Its datablock: if that is linked, // is the folder of the .blend that it is linked from.
    """
    if path.startswith("//"):
        # By the text, as Blender does it: a folder on the way may be a link.
        library = owner.library if owner is not None else None
        path = os.path.normpath(bpy.path.abspath(path, library=library))
    return Path(path).resolve()


def relative(path: str | Path, folder: Path | None = None) -> str:
    """Return a path as a .blend in a folder stores it, with // for the folder, by default this .blend's.

    It is unchanged if it cannot be relative: on another drive, or in an unsaved .blend.
    """
    text, here = str(path), bpy.data.filepath
    if folder is None:
        if not here:
            return text
        folder = Path(here).parent
    if text.startswith("//"):
        if not here:
            return text
        text = bpy.path.abspath(text)
    try:
        # Slashes are understood everywhere, backslashes are not.
        return "//" + os.path.relpath(text, folder).replace(os.sep, "/")
    except ValueError:
        return text


def own_file(owner: bpy.types.ID) -> Path | None:
    """Return the .blend of a datablock, which is another one if it is linked; None while unsaved."""
    file = bpy.path.abspath(owner.library.filepath) if owner.library is not None else bpy.data.filepath
    return Path(file) if file else None


@at("save_pre")
def _save_pre(filepath: str, _unused: object) -> None:
    _before.clear()
    if not filepath:
        return
    folder = Path(filepath).absolute().parent
    for scene in bpy.data.scenes:
        if scene.library is not None:
            continue
        for owner, name in owned(scene):
            value = getattr(owner, name)
            kept = relative(value, folder) if value else value
            # The last separator distinguishes a folder from the beginning of a file name.
            kept += "/" if value.endswith(("/", os.sep)) and not kept.endswith("/") else ""
            if kept != value:
                _before.append((owner, name, value))
                setattr(owner, name, kept)


def owned(scene: bpy.types.Scene) -> list[tuple[bpy.types.bpy_struct, str]]:
    """Owners and properties of our paths in a scene, with that of its output while it is the one we set."""
    settings = scene.virtual_aperture
    paths = [*((settings, name) for name in PATHS), (settings.shape, "image")]
    if settings.output and scene.render.filepath == settings.output:
        paths += [(scene.render, "filepath"), (settings, "output")]
    return paths


@at("save_post")
def _save_post(filepath: str, _unused: object) -> None:
    here = bpy.data.filepath
    # A copy lies elsewhere than the file that stays open.
    if not here or Path(here).parent != Path(filepath).absolute().parent:
        _restore()
    _before.clear()


@at("save_post_fail")
def _restore(*_: object) -> None:
    for owner, name, value in _before:
        setattr(owner, name, value)
    _before.clear()
