"""Solving a clip, and building its solve into the scene."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ...core.base.counting import counted
from ...core.base.errors import UserError, with_words
from ...core.media.clip import Footage
from ...core.media.sequence import is_pattern
from ...core.readers.matching import Imported
from ...core.sfm.process import Opening, SolveProcess
from ...core.sfm.state import STATE
from ...core.sfm.workspace import Solve, load_solve
from ...render.viewport import viewport
from ...scene.base import redraw
from ...scene.base.paths import absolute, relative
from ...scene.base.remedy_words import WORDS
from ...scene.build import build
from ...scene.focus import focus_marks
from ...scene.focus.refocus import keep_focus, restore_focus
from ...scene.lens.lens import focal_of
from ...scene.sources.clip import footage_path, work_dir
from ..base.meanwhile import Meanwhile
from ..base.operators import Result, has_clip, is_idle, may_change, polls
from ..base.solving import Solving
from ..jobs import depth_ahead, first_person
from . import after_solve

LATE = 0.5
"""Share of a solve after which the preview's process starts, which takes 2 to 3 s: the user may press Preview
as the solve ends."""


def is_kept(settings: Any) -> bool:
    """Return whether the working folder has a solve or an import; fast enough for drawing."""
    return bool(settings.footage) and (work_dir(settings, footage_path(settings)) / STATE).exists()


def build_scene(scene: bpy.types.Scene, footage: Footage, folder: Path) -> tuple[Solve, str]:
    """Build the solve of a working folder into a scene; return it, and a note on its focus, or ""."""
    solve = load_solve(folder, footage.path)
    footage = solve.open_clip(footage.frames)
    kept = keep_focus(scene.virtual_aperture, footage.path)
    points = scene.virtual_aperture.points
    if points is not None and points.mode == "EDIT":
        # A mesh cannot be filled there. The window may show another scene meanwhile.
        layer = scene.view_layers[0]
        with bpy.context.temp_override(scene=scene, view_layer=layer, active_object=points):
            bpy.ops.object.mode_set(mode="OBJECT")
    settings = build(scene, footage, solve.reconstruction)
    settings.solved_in = relative(folder)
    settings.summary = solve.summary
    settings.advice = with_words(solve.quality.advice, solve.quality.remedies, WORDS)
    note = ""
    if kept is not None:
        note = restore_focus(settings, kept, solve.reconstruction)
    else:
        # So that the first render shows the effect.
        focus_marks.set_first(settings, solve.reconstruction)
    after_solve.show(scene, solve.reconstruction)
    viewport.warm()
    return solve, note


def kept_words(folder: Path) -> str:
    """Return the content of a working folder in a line, for a question before it is replaced."""
    made = time.strftime("%d %B %Y, %H:%M", time.localtime((folder / STATE).stat().st_mtime))
    try:
        solve = load_solve(folder)
        quality = solve.quality
        kind = solve.figures.method if quality.focal_from == "file" else "Solve"
    except UserError:
        # Its clip is gone, or it is damaged.
        return f"Solve of {made}"
    registered = f"{quality.registered} of {quality.frames} frames"
    return f"{kind} of {made}: {registered}, {counted(quality.points, 'point')}"


def solved_words(scene: bpy.types.Scene) -> str:
    """Return that a clip is solved, and the automatic focus, in one line; the figures are in the panel."""
    settings = scene.virtual_aperture
    if not settings.marks.is_first:
        return "Solved"
    return f"Solved, and focused on {first_person.in_focus(settings)}. Pick Focus changes that"


def focus_on_person(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Put the nearest subject in focus, unless the user has picked a focus.

    Args:
        operator: Reports a warning if people cannot be searched for.
        scene: Scene with a solve.
    """
    try:
        first_person.focus(scene)
    except UserError as error:
        operator.report({"WARNING"}, f"People were not detected: {error.worded(WORDS)}")


def report_hidden(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Say what was hidden for the camera, if anything."""
    if things := after_solve.still_hidden(scene):
        operator.report({"INFO"}, after_solve.hidden_words(things))


class Solves(Meanwhile):
    """Solve a clip, with ESC to cancel, and bring it into the scene as one undo step.

    Until then the scene is not touched.
    """

    bl_options = {"UNDO"}  # noqa: RUF012

    sure: bpy.props.BoolProperty(
        name="Do Not Ask", description="The user has confirmed", options={"SKIP_SAVE", "HIDDEN"}
    )

    again = False
    _solving: Solving | None = None
    _scene = ""
    _folder_set = ""
    _depth: Path | None = None
    _cameras: Imported | None = None
    """Cameras that are known and held; None where they are to be found, too."""

    def solved_clip(self, settings: Any) -> tuple[Path, str]:
        """Return the clip to solve, and the settings' working folder."""
        raise NotImplementedError

    def begin(self, context: bpy.types.Context) -> None:
        settings = context.scene.virtual_aperture
        clip, self._folder_set = self.solved_clip(settings)
        # It also looks into the folder that is about to change.
        self._depth = depth_ahead.give_way()
        # The user may go to another scene meanwhile.
        self._scene = context.scene.name
        stills = settings.stills and (clip.is_dir() or is_pattern(clip))
        self._solving = Solving(
            partial(
                SolveProcess,
                clip,
                work_dir(settings, clip, self._folder_set),
                focal=focal_of(settings),
                again=self.again,
                zooms=settings.lens == "ZOOM",
                yielding=not bpy.app.background,
                cameras=self._cameras,
                stills=stills,
                pixel_aspect=settings.pixel_aspect,
                fixed=settings.fixed,
                segmenter=absolute(settings.segmenter, context.scene) if settings.segmenter else None,
                depth_maps=absolute(settings.depth_maps, context.scene) if settings.depth_maps else None,
            ),
            clip.name,
            None if bpy.app.background else Opening(clip, stills),
        )
        if not bpy.app.background:
            Solving.running = self._solving
            context.window_manager.progress_begin(0, 100)

    def look(self) -> bool:
        solving = self._solving
        assert solving is not None
        before, share = (solving.sight, solving.step.stage), solving.step.share
        solving.poll()
        if share <= LATE < solving.step.share:
            viewport.warm(soon=True)
        if (solving.sight, solving.step.stage) != before:
            redraw.viewports()
        return solving.finished

    def show(self, context: bpy.types.Context) -> None:
        assert self._solving is not None
        step = self._solving.step
        context.window_manager.progress_update(100 * step.share)
        context.workspace.status_text_set(f"Virtual Aperture: {step.text}    (ESC cancels)")
        redraw.panels()

    def end(self) -> None:
        if self._solving is not None:
            self._solving.cancel()
        if not bpy.app.background:
            bpy.context.window_manager.progress_end()
            redraw.viewports()

    def give_up(self) -> None:
        viewport.warm()
        depth_ahead.begin_after_solve(self._depth)

    def stopped(self) -> str:
        return "Solve cancelled; nothing was changed"

    def conclude(self: Any) -> Result:
        assert self._solving is not None and self._solving.process is not None
        process, scene = self._solving.process, bpy.data.scenes.get(self._scene)
        if scene is None:
            raise UserError(
                f"the scene {self._scene!r} no longer exists; its solve is kept in {process.work_dir}"
            )
        solve, note = build_scene(scene, process.clip, process.work_dir)
        scene.virtual_aperture.work_dir = self._folder_set
        depth_ahead.begin_after_solve(process.work_dir)
        focus_on_person(self, scene)
        report_hidden(self, scene)
        notes = solve.quality.notes if self._cameras is not None else []
        for each in (*notes, *([note] if note else [])):
            self.report({"WARNING"}, each)
        self.report({"INFO"}, solved_words(scene))
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_solve(Solves, bpy.types.Operator):  # noqa: N801
    """Find the clip's camera motion and feature points, and add them to the scene"""

    bl_label = "Solve Clip"
    # Not REGISTER: its redo panel would solve once more, with the interface frozen.

    again: bpy.props.BoolProperty(
        name="Solve Again",
        description="Solve even if the working folder already holds a solve",
        options={"SKIP_SAVE"},
    )

    poll = polls(is_idle, may_change, has_clip)

    def solved_clip(self, settings: Any) -> tuple[Path, str]:
        return footage_path(settings), settings.work_dir

    def question(self, context: bpy.types.Context) -> dict[str, str]:
        settings = context.scene.virtual_aperture
        if not self.again or self.sure or not is_kept(settings):
            return {}
        folder = work_dir(settings, footage_path(settings))
        title, message = f"Replace the solve in {folder.name}?", kept_words(folder)
        return {"title": title, "message": message, "confirm_text": "Solve Again"}
