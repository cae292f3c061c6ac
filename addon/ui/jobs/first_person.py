"""The nearest subject in focus after a solve, found in the background while nobody has picked a focus."""

from dataclasses import dataclass
from functools import partial

import bpy

from ...core.base.errors import UserError
from ...core.focus.place import Place
from ...core.frame.first_person import nearest_subject, scale_by_people
from ...render.processes.clip_process import ClipProcess
from ...scene.base import redraw
from ...scene.base.events import at, watch
from ...scene.focus import focus_marks
from ...scene.lens import depth_of_field
from ...scene.sources.shot import IDENTITY, Shot, points_mesh, shot_of
from ..base.work import Work

Found = tuple[Place | None, float | None]
"""The nearest subject, and metres per scene unit by the people of the clip."""
LOOK = 0.5
"""Seconds between two looks at the search."""


@dataclass(frozen=True)
class Search:
    """A search for the nearest subject that is under way."""

    work: Work[Found]
    process: ClipProcess
    scene: str
    """The scene's name: it may be renamed or removed meanwhile."""
    solve: str
    """Identity of the solve that it looks in."""

    def settings(self) -> bpy.types.PropertyGroup | None:
        """Return the settings that wait for the result; None after a pick of the focus or another solve."""
        scene = bpy.data.scenes.get(self.scene)
        if scene is None or scene.virtual_aperture.points is None:
            return None
        settings = scene.virtual_aperture
        waits = settings.marks.is_first and _identity(settings) == self.solve
        return settings if waits else None


_searches: list[Search] = []
"""The one under way, at most."""


def focus(scene: bpy.types.Scene) -> None:
    """Put the nearest subject in focus if no focus was picked: in the window once one is found, else now.

    Raises:
        UserError: As of `shot_of` and `nearest_subject`.
    """
    settings = scene.virtual_aperture
    stop()
    if not settings.marks.is_first:
        return
    if bpy.app.background:
        _put(settings, _found(shot_of(scene)))
        return
    # In another process than the preview, which goes on.
    own = ClipProcess(yields=True)
    work = Work(partial(_found, shot_of(scene)), own)
    _searches.append(Search(work, own, scene.name, _identity(settings)))
    watch(_tick, LOOK)


def in_focus(settings: bpy.types.PropertyGroup) -> str:
    """Return what is in focus while nobody has picked a focus."""
    return str(settings.marks.items[0].places[0].source)


def words() -> str:
    """Return a line about the search that is under way; empty without one."""
    return f"Looking for subjects {_searches[0].work.stage}" if _searches else ""


@at("load_pre")
def stop(*_: object) -> None:
    """End the search that is under way."""
    while _searches:
        _searches.pop().process.end()


def _identity(settings: bpy.types.PropertyGroup) -> str:
    return str(points_mesh(settings).get(IDENTITY))


def _found(shot: Shot) -> Found:
    return nearest_subject(shot.context), scale_by_people(shot.context)


def _put(settings: bpy.types.PropertyGroup, found: Found) -> None:
    place, scale = found
    if scale:
        depth_of_field.guess_scale(settings, scale)
    if place is not None:
        focus_marks.put_first(settings, place)


def _must_wait(settings: bpy.types.PropertyGroup) -> bool:
    """Whether an operator waits for the mouse, Blender renders, or the cloud is in Edit Mode."""
    windows = bpy.context.window_manager.windows
    modal = (operator.bl_idname for window in windows for operator in window.modal_operators)
    is_operating = any(name.startswith("VIRTUAL_APERTURE_OT_") for name in modal)
    return is_operating or bpy.app.is_job_running("RENDER") or settings.points.mode == "EDIT"


def _tick() -> float | None:
    """A timer's turn; None when the search has ended."""
    if not _searches:
        return None
    search = _searches[0]
    settings = search.settings()
    if settings is None:
        stop()
        redraw.panels()
        return None
    if not search.work.ended():
        redraw.panels()
        return LOOK
    if _must_wait(settings):
        return LOOK
    stop()
    redraw.panels()
    # An unreadable frame is reported where it is rendered; the focus is as it was.
    if isinstance(search.work.error, UserError):
        return None
    found = search.work.result()
    _put(settings, found)
    if found[0] is not None:
        window = bpy.context.window_manager.windows[0]
        with bpy.context.temp_override(window=window):
            bpy.ops.ed.undo_push(message="Focus on Nearest Person")
    return None
