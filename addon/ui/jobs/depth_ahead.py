"""Depth found in the background once a clip is solved: renders and other focuses then need not find it."""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.base.messages import Failure
from ...core.base.worker import Worker
from ...core.sfm.state import STATE
from ...render.processes.launcher import start, write_blend
from ...scene.base import redraw
from ...scene.base.events import at, watch
from ...scene.base.remedy_words import WORDS
from ...scene.sources.clip import footage_path, work_dir
from ...scene.sources.colour_space import REC_709, working_space
from ...scene.sources.shot import reconstruction_of
from ...scene.sources.subjects import marked_of
from ..base.operators import Acts, has_solve, is_met, polls, requires
from ..base.text import progress_row

LOOK = 0.5
"""Seconds between two looks at the process."""


class DepthAhead(Worker):
    """The process that finds the depth of a solved clip's frames and keeps it in its working folder."""

    def __init__(self, work: Path) -> None:
        super().__init__()
        self.work = work

    def opened(self) -> Path:
        """Return the working folder, or a copy of a .blend with moving pixels or a colour space."""
        settings = bpy.context.scene.virtual_aperture
        if not settings.footage or _folder(settings) != self.work or settings.points is None:
            return self.work
        is_plain = not settings.colour_space and working_space() == REC_709
        if is_plain and not (settings.masks or settings.mask or marked_of(settings)):
            return self.work
        blend = self.folder / "scene.blend"
        write_blend(blend)
        return blend

    @property
    def problem(self) -> str:
        """Why it failed, in the interface's words; empty where it has not."""
        return "" if self.failure is None else self.failure.error.worded(WORDS)


_ahead: DepthAhead | None = None
"""The one of this Blender: it takes as many processes as fit, so there are not two."""


def begin(work: Path) -> None:
    """Find depth for the solve in a working folder, in place of the present work.

    Raises:
        UserError: No process can be started.
    """
    global _ahead
    stop()
    made = DepthAhead(work)
    start(made, ["depth", made.opened()])
    _ahead = made
    _remember(work, True)
    watch(_tick, LOOK)


def begin_after_solve(work: Path | None) -> None:
    """Call `begin` in a window with a working folder; the panel shows an error.

    Before a camera that stays there is no depth to find.
    """
    global _ahead
    if bpy.app.background or work is None or _stays():
        return
    try:
        begin(work)
    except UserError as error:
        _ahead = DepthAhead(work)
        _ahead.failure = Failure(str(error), remedies=error.remedies)


def _stays() -> bool:
    """Return whether the scene's camera stays, without depth maps."""
    settings = bpy.context.scene.virtual_aperture
    return settings.points is not None and not settings.depth_maps and reconstruction_of(settings).stays


@at("load_pre")
def stop(*_: object) -> None:
    """End the present work without waiting; finished frames are kept."""
    global _ahead
    if _ahead is not None:
        _ahead.leave()
    _ahead = None


def give_way() -> Path | None:
    """Call `stop` for work that needs all processors; returns the folder for `begin_after_solve`."""
    if _ahead is None or not _ahead.is_running:
        return None
    work = _ahead.work
    stop()
    return work


def pause() -> None:
    """Call `stop` for the user: it does not continue when the file is opened again."""
    if _ahead is not None:
        _remember(_ahead.work, False)
    stop()


def _remember(work: Path, finds_depth: bool) -> None:
    """Note in the scenes with this working folder whether its depth is being found."""
    for scene in bpy.data.scenes:
        settings = scene.virtual_aperture
        if scene.library is None and settings.footage and _folder(settings) == work:
            settings.finds_depth = finds_depth


def of(settings: bpy.types.PropertyGroup) -> DepthAhead | None:
    """Return the present or finished work for the clip of the settings."""
    if _ahead is None or not settings.footage or _ahead.work != _folder(settings):
        return None
    return _ahead


def _folder(settings: bpy.types.PropertyGroup) -> Path:
    return work_dir(settings, footage_path(settings))


def _tick() -> float | None:
    """A timer's turn: panels show how far it is; None when it has ended."""
    if _ahead is None:
        return None
    if _ahead.poll() or not _ahead.is_running:
        redraw.panels()
    if _ahead.is_running:
        return LOOK
    if _ahead.failure is None:
        _remember(_ahead.work, False)
    return None


@at("load_post")
def _on_open(*_: object) -> None:
    settings = bpy.context.scene.virtual_aperture
    if not (settings.finds_depth and settings.footage and settings.points is not None):
        return
    folder = _folder(settings)
    if (folder / STATE).exists():
        begin_after_solve(folder)


class VIRTUAL_APERTURE_OT_find_depth(Acts, bpy.types.Operator):  # noqa: N801
    """Find and keep the depth of all frames in the background, so that renders start faster"""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        found = of(context.scene.virtual_aperture)
        is_free = found is None or not found.is_running
        return has_solve(cls, context) and is_met(cls, is_free, "Depth is being found")

    def act(self, context: bpy.types.Context) -> None:
        folder = _folder(context.scene.virtual_aperture)
        if not (folder / STATE).exists():
            raise UserError(f"{folder} holds no solve to keep depth with; solve the clip")
        begin(folder)


class VIRTUAL_APERTURE_OT_pause_depth(Acts, bpy.types.Operator):  # noqa: N801
    """Stop finding depth. Found depth is kept, and Find Depth continues from there"""

    bl_label = "Pause"

    poll = polls(requires(lambda _: _ahead is not None and _ahead.is_running, "Depth is not being found"))

    def act(self, _context: bpy.types.Context) -> None:
        pause()


def draw_progress(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> bool:
    """Draw the progress with a button to pause; returns whether work is in progress."""
    found = of(settings)
    if found is None or not found.is_running:
        return False
    words = f"Depth: {found.done} of {found.total} frames" if found.total else "Depth: starting"
    stop = VIRTUAL_APERTURE_OT_pause_depth.bl_idname
    progress_row(layout, words, found.share, found.left, stop, "PAUSE")
    return True


def draw(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """Draw the progress with a button to pause, or the button to begin."""
    if draw_progress(layout, settings):
        return
    found = of(settings)
    is_whole = found is not None and found.total > 0 and found.done == found.total
    if is_whole:
        layout.label(text="Depth is found", icon="CHECKMARK")
    else:
        layout.operator(VIRTUAL_APERTURE_OT_find_depth.bl_idname, icon="PLAY")
