"""Clicks on the camera's picture, as the scene has its clip and subjects."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial

import bpy

from ...core.base.arrays import Mask
from ...core.focus.place import Place, PlaceFinder
from ...core.frame.clicked import clicked
from ...core.frame.clip_context import ClipContext
from ...core.frame.repaired_depth import repaired_places
from ...core.subjects.strokes import MarkedSubject
from ..lens.lens import focus_of, is_in_focus
from ..lens.repairs import repairs_of
from ..sources.shot import Shot, shot_of
from ..sources.subjects import free_name


def places(settings: bpy.types.PropertyGroup, clip: ClipContext, frame: int) -> PlaceFinder:
    """Return the finder of focus in a registered frame, by depth as the repairs of the settings leave it.

    Raises:
        UserError: The frame has no camera.
    """
    focus = focus_of(settings) if is_in_focus(settings) else None
    return repaired_places(clip, frame, repairs_of(settings), focus)


def place_at(
    scene: bpy.types.Scene,
    finder: PlaceFinder,
    x: float,
    y: float,
    taken: Collection[str] = (),
    seen: Callable[[Mask], object] = lambda mask: None,
) -> Callable[[], Place]:
    """Return a function that finds what a click puts in focus, as `clicked`; a thread may call it.

    Args:
        scene: The scene.
        finder: The one of its clip and the frame.
        x: Share of the picture's width from the left.
        y: Share of its height from the top.
        taken: Names of subjects that are not in the scene yet.
        seen: As of `clicked`.

    Raises:
        UserError: As of `shot_of`.
    """
    shot, name = shot_of(scene), free_name(scene.virtual_aperture, taken)
    return partial(clicked, shot.context, finder, x, y, name, partial(_marking, shot), seen)


def _marking(shot: Shot, new: MarkedSubject) -> ClipContext:
    return shot.with_subjects((*shot.subjects, new)).context
