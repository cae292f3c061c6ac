"""Scenes that are saved, opened as version 1.0 stored them, or appended from another .blend."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.focus.focus import Focus
from ..core.focus.place import Place
from ..core.focus.pull import EASINGS, FocusMark
from .base import paths
from .base.events import at
from .base.version import VERSION
from .focus.kept_marks import at_distance
from .lens import lens

POINTS = 0
"""Number of the item of `focus_by` with which points counted before the distance in version 1.0."""


@at("save_pre")
def _on_save(*_: object) -> None:
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        if scene.library is None and settings.footage and settings.version < VERSION:
            settings.version = VERSION


@at("load_post")
def _on_load(*_: object) -> None:
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        _take_focus_over(settings)
        # Version 1.0 had two more.
        settings.method = settings.method or "features"


@at("blend_import_post")
def _on_import(imported: bpy.types.BlendImportContext) -> None:
    """Scenes that were appended: their paths are relative to the .blend that they come from."""
    _on_load()
    for item in imported.import_items:
        if item.id_type != "SCENE" or item.id is None or item.id.library is not None:
            continue
        if item.source_library is not None:
            file = Path(bpy.path.abspath(item.source_library.filepath))
            _from_folder(item.id, str(file.parent))


def _from_folder(scene: bpy.types.Scene, folder: str) -> None:
    """Paths that were relative to a folder, relative to this .blend."""
    for owner, name in paths.owned(scene):
        if (value := getattr(owner, name)).startswith("//"):
            setattr(owner, name, paths.relative(bpy.path.abspath(value, start=folder)))


def look() -> None:
    """Bring the scenes that are open up to date, as of a file that is opened."""
    if hasattr(bpy.data, "scenes"):
        _on_load()
    else:
        # Blender hides its data while an extension is enabled.
        bpy.app.timers.register(_on_load, first_interval=0)


def _take_focus_over(settings: bpy.types.PropertyGroup) -> None:
    """Replace what version 1.0 stored of the focus by marks; settings of later versions stay as they are."""
    stored: Any = settings.bl_system_properties_get()
    if stored is None:
        return
    group: Any = stored.get("marks") or {}
    is_first = bool(group.pop("is_first", False)) if group else False
    for mark, old in zip(settings.marks.items, group.get("items", ()), strict=True):
        if "frame" in old:
            _take_mark_over(mark, old, is_first)
    if not {"focus_by", "focus_points"} & set(stored.keys()):
        return
    points = tuple(each.get("point", 0) for each in stored.pop("focus_points", ()))
    points = points if stored.pop("focus_by", POINTS) == POINTS else ()
    frame, distance = stored.pop("focus_frame", 0), settings.focus_distance
    marks = settings.marks.items
    has_place = len(marks) or lens.is_keyed(settings, "focus_distance") or not distance > 0
    if points == settings.marks.points and has_place:
        return
    # Points or a distance that a command or a script had set.
    marks.clear()
    focus = Focus(points, through_points=settings.focus_through_points)
    place = Place(focus, frame, distance, "points") if points else at_distance(distance, frame)
    marks.add().fill(FocusMark(frame, (place,)))


def _take_mark_over(mark: bpy.types.PropertyGroup, old: Any, is_first: bool) -> None:
    """Keep a mark that version 1.0 stored field by field."""
    frame, distance = old.pop("frame"), mark.distance
    places = [_place(each, is_first) for each in old.pop("places", ())] or [at_distance(distance, frame)]
    easing, pull, holds = (
        list(EASINGS)[old.pop("easing", 0)],
        old.pop("pull", 0),
        bool(old.pop("holds", False)),
    )
    mark.fill(FocusMark(frame, tuple(places), easing, pull, holds, mark.name))
    mark.distance = distance


def _place(old: Any, is_first: bool) -> Place:
    points, distance = tuple(each.get("point", 0) for each in old.get("points", ())), old.get("distance", 0.0)
    through = bool(old.get("through_points", False))
    x, y = old.get("xy", (-1, -1))
    return Place(
        Focus(points, through_points=through) if points else Focus(distance=distance),
        old.get("frame", 0), distance, old.get("source", ""),
        np.array(old["world"]) if old.get("has_world", False) else None,
        dict(zip(old.get("followed_frames", ()), old.get("followed", ()), strict=True)),
        (x, y) if x >= 0 else None, is_automatic=is_first,
    )  # fmt: skip
