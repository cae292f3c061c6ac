"""Clicks on the camera's picture, as the scene has its clip and subjects."""

from collections.abc import Callable, Collection, Sequence
from functools import partial

import bpy

from ...core.base.calls import show
from ...core.focus.focus import Focus
from ...core.focus.place import Place, PlaceFinder
from ...core.frame.clicked import clicked
from ...core.frame.clip_context import ClipContext
from ...core.frame.repaired_depth import repaired_places
from ...core.frame.repairs import Repair
from ...core.subjects.strokes import MarkedSubject
from ..lens.lens import focus_of, is_in_focus
from ..lens.repairs import repairs_of
from ..sources.shot import Shot, shot_of
from ..sources.subjects import free_name

Repaired = tuple[Sequence[Repair], Focus | None]
"""As of `repaired_places`."""


def places(settings: bpy.types.PropertyGroup, clip: ClipContext, frame: int) -> PlaceFinder:
    """Return the finder of focus in a registered frame, by depth as the repairs of the settings leave it.

    Raises:
        UserError: The frame has no camera.
    """
    return repaired_places(clip, frame, *_repaired(settings))


def surface_at(scene: bpy.types.Scene, frame: int, x: float, y: float) -> Callable[[], Place]:
    """Return a function that finds the surface at a place of a frame; another process may call it.

    Args:
        scene: The scene.
        frame: The clip's frame.
        x: Share of the picture's width from the left.
        y: Share of its height from the top.

    Raises:
        UserError: As of `shot_of`.
    """
    return partial(_surface, shot_of(scene), frame, _repaired(scene.virtual_aperture), x, y)


def place_at(
    scene: bpy.types.Scene, frame: int, x: float, y: float, taken: Collection[str] = ()
) -> Callable[[], Place]:
    """Return a function that finds what a click puts in focus, as `clicked`; another process may call it.

    It shows (`calls.show`) the subject (h, w) before it is tracked through the other frames.

    Args:
        scene: The scene.
        frame: The clip's frame.
        x: Share of the picture's width from the left.
        y: Share of its height from the top.
        taken: Names of subjects that are not in the scene yet.

    Raises:
        UserError: As of `shot_of`.
    """
    settings = scene.virtual_aperture
    return partial(_clicked, shot_of(scene), frame, _repaired(settings), x, y, free_name(settings, taken))


def _repaired(settings: bpy.types.PropertyGroup) -> Repaired:
    return repairs_of(settings), focus_of(settings) if is_in_focus(settings) else None


def _surface(shot: Shot, frame: int, repaired: Repaired, x: float, y: float) -> Place:
    return repaired_places(shot.context, frame, *repaired).find(x, y)


def _clicked(shot: Shot, frame: int, repaired: Repaired, x: float, y: float, name: str) -> Place:
    finder = repaired_places(shot.context, frame, *repaired)
    return clicked(shot.context, finder, x, y, name, partial(_marking, shot), show)


def _marking(shot: Shot, new: MarkedSubject) -> ClipContext:
    return shot.with_subjects((*shot.subjects, new)).context
