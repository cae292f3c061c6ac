"""The clip of a scene's solve: whether the path leads to it, and where it is if not."""

import time
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.base.errors import Remedy, UserError
from ...core.media.clip import Footage, FrameRange
from ...core.media.clip_identity import clip_exists, find_clip, is_clip
from ...core.sfm.state import STATE
from ...core.sfm.workspace import recorded_clip
from ..base.paths import absolute, own_file
from ..base.preferences import preferred_work_dir

LOOK_AGAIN = 3.0
"""Seconds until a clip that was not found is looked for again: panels ask with every redraw."""
WHILE_PLAYED = 1.0
"""Seconds for which a look at the clip's files counts while frames are played: it lists the pictures of a
sequence, which takes 20 ms for 500 of them, and a frame of 24 a second has 42."""


@dataclass(frozen=True)
class Trouble:
    """Why the chosen clip is not the one that was solved."""

    text: str
    """The problem, for the user."""
    is_missing: bool
    """Nothing is where the path leads; else it leads to another clip."""
    found: Path | None = None
    """Path of the solved clip if it was moved."""


_looks: dict[tuple[str, str, bool], tuple[float, Trouble | None]] = {}
_searches: dict[tuple[str, ...], tuple[float, Path | None]] = {}


def footage_path(settings: bpy.types.PropertyGroup) -> Path:
    """Return the path of the chosen clip, with Blender's // resolved; UserError where none is chosen."""
    if not settings.footage:
        raise UserError("no clip has been chosen")
    return absolute(settings.footage, settings.id_data)


def solved_clip_path(settings: bpy.types.PropertyGroup, within: float = 0.0) -> Path:
    """Return the path of the solved clip: the set one, or one where it was found again.

    `within` as of `trouble_with`.

    Raises:
        UserError: Another clip is set, or it is not found.
    """
    path = footage_path(settings)
    trouble = trouble_with(settings, at_a_glance=False, within=within)
    if trouble is None:
        return path
    if trouble.found is None:
        raise UserError(trouble.text, *(() if trouble.is_missing else (Remedy.SOLVE,)))
    return trouble.found


def solved_part(settings: bpy.types.PropertyGroup, clip: Footage) -> Footage:
    """Open the frames of the clip that were solved."""
    solved = FrameRange(settings.clip_first, settings.clip_last, settings.clip_step)
    return clip.part(solved.of(clip.frames))


def trouble_with(
    settings: bpy.types.PropertyGroup, at_a_glance: bool = True, within: float = 0.0
) -> Trouble | None:
    """Return the problem with the path of the solved clip; None without one, or without a solve.

    It is fast enough for a panel; without `at_a_glance` all bytes of a large clip are read once. An answer of
    the last `within` seconds is given again.
    """
    if settings.points is None or not settings.footage:
        return None
    path, now = footage_path(settings), time.monotonic()
    key = (str(path), settings.clip_identity, at_a_glance)
    if key not in _looks or now - _looks[key][0] >= within:
        _looks[key] = now, _trouble(settings, path, at_a_glance)
    return _looks[key][1]


def _trouble(settings: bpy.types.PropertyGroup, path: Path, at_a_glance: bool) -> Trouble | None:
    wanted, name = settings.clip_identity, settings.clip_name
    if not clip_exists(path):
        found = _found(settings, path, at_a_glance)
        if found is not None:
            return Trouble(
                f"the clip {path.name} has moved from {path.parent} to {found.parent}", True, found
            )
        text = (
            f"the clip {name} is missing from {path.parent}, and is not next to the .blend or below it"
            " either; put it back, or locate it with Find Clip"
        )
        return Trouble(text, True)
    if is_clip(path, wanted, at_a_glance):
        return None
    if path.name == name:
        text = f"the clip {path} is not the {name} that was solved; solve it, or put the original back"
    else:
        text = (
            f"the solve belongs to {name}, but the chosen clip is {path.name}; solve it, or choose {name}"
            " again"
        )
    return Trouble(text, False)


def _found(settings: bpy.types.PropertyGroup, path: Path, at_a_glance: bool) -> Path | None:
    file = own_file(settings.id_data)
    beside = file.parent if file is not None else None
    folder = work_dir(settings, path)
    wanted = settings.clip_identity
    key = (str(path), wanted, str(beside), str(folder), str(at_a_glance))
    if key in _searches:
        when, found = _searches[key]
        if time.monotonic() - when < LOOK_AGAIN or (found and is_clip(found, wanted, at_a_glance)):
            return found
    recorded = recorded_clip(folder)
    places = [] if recorded is None else [recorded]
    found = find_clip(settings.clip_name or path.name, wanted, places, beside, at_a_glance)
    _searches[key] = (time.monotonic(), found)
    return found


def work_dir(settings: bpy.types.PropertyGroup, clip: Path, chosen: str | None = None) -> Path:
    """Return the working folder: the chosen or set one, or a clip's default.

    The default is in the cache folder of the preferences, else beside the .blend, or beside the clip before
    that is saved. The folder of the scene's solve stays in use when the .blend is saved elsewhere.
    """
    chosen = settings.work_dir if chosen is None else chosen
    if chosen:
        return absolute(chosen, settings.id_data)
    file = own_file(settings.id_data)
    default = preferred_work_dir(clip, file.parent if file is not None else clip.parent)
    if not settings.solved_in or (default / STATE).exists():
        return default
    solved, is_moved = absolute(settings.solved_in, settings.id_data), not clip_exists(clip)
    is_solved = is_moved or is_clip(clip, settings.clip_identity, at_a_glance=True)
    return solved if is_solved and (solved / STATE).exists() else default


def forget() -> None:
    """Look for clips anew."""
    _searches.clear()
    _looks.clear()
