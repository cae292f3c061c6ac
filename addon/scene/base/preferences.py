"""The extension's preferences, as the scene's parts ask for them."""

import hashlib
from pathlib import Path

import bpy

from ...core.base import limits
from ...core.sfm.state import STATE
from ...core.sfm.workspace import default_work_dir

PACKAGE = ".".join(__package__.split(".")[:-3]) or __package__.split(".")[0]
"""Blender's name of the extension; in a checkout, the add-on's folder."""
GB = 1 << 30
"""Bytes of a GB in the preferences."""


def preferences() -> bpy.types.AddonPreferences | None:
    """Return the user's preferences; None if the extension is not enabled in Blender."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon is not None else None


def preferred_work_dir(clip: Path, beside: Path) -> Path:
    """Return the working folder of a clip without one: in the cache folder, if there is one, else `beside`.

    An existing solve there stays in use. In the cache folder its name includes the clip's path: many clips
    have the same name.
    """
    default, chosen = default_work_dir(clip, beside), preferences()
    if chosen is None or not chosen.cache_folder or (default / STATE).exists():
        return default
    digest = hashlib.sha256(str(clip.absolute()).encode()).hexdigest()[:8]
    return Path(bpy.path.abspath(chosen.cache_folder)) / f"{default.stem}-{digest}{default.suffix}"


def preferred_segmenter() -> str:
    """Return the absolute path of the preferred segmenter, empty if none is named.

    Blender stores a path beside the open .blend as relative to it; the preferences count for all of them.
    """
    chosen = preferences()
    return bpy.path.abspath(chosen.segmenter) if chosen is not None and chosen.segmenter else ""


def apply() -> None:
    """Apply the preferences to the core; without them the environment counts."""
    chosen = preferences()
    if chosen is not None:
        limits.limit_threads(chosen.threads)
        limits.limit_kept_depth(round(chosen.kept_depth * GB))
