"""Solving a clip, and common code of the operators."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..core.base.counting import counted
from ..core.base.errors import UserError, with_words
from ..core.media.clip import Footage
from ..core.media.sequence import is_pattern
from ..core.readers.matching import Imported
from ..core.sfm.process import SolveProcess
from ..core.sfm.state import STATE
from ..core.sfm.workspace import Solve, imported_from, load_solve
from ..scene import aperture_cloud, focus_marks, parts, redraw, version
from ..scene.build import build
from ..scene.clip import footage_path, work_dir
from ..scene.lens import focal_of, is_in_focus
from ..scene.paths import absolute
from ..scene.refocus import keep_focus, restore_focus
from ..scene.remedy_words import WORDS
from . import after_solve, depth_ahead, first_person
from .solving import Solving

Result = set[str]

NO_CAMERA = "The camera was deleted; Restore Objects, at the top, brings it back"

LOOK = 0.1
"""Seconds between two looks at the solving process."""


def may_change(cls: Any, context: bpy.types.Context) -> bool:
    """Poll whether changes of the scene will be saved."""
    try:
        check_may_change(context.scene)
    except UserError as error:
        cls.poll_message_set(sentence(str(error)))
        return False
    return True


def check_may_change(scene: bpy.types.Scene) -> None:
    """Check that changes of the scene will be saved.

    Raises:
        UserError: The scene is linked, or a newer version made it.
    """
    if scene.library is not None:
        file = Path(scene.library.filepath).name
        raise UserError(f"{scene.name} is linked from {file}; open that file, or append the scene from it")
    version.check(scene.virtual_aperture)


def sentence(text: str) -> str:
    """Return a message as a button's or a panel's text begins."""
    return text[0].upper() + text[1:]


def is_met(cls: Any, condition: object, message: str) -> bool:
    """Poll a condition; `message` is the button's reason otherwise."""
    if not condition:
        cls.poll_message_set(message)
    return bool(condition)


def is_idle(cls: Any) -> bool:
    """Poll: no clip is being solved."""
    return is_met(cls, running_solve() is None, "A clip is being solved; ESC cancels it")


def has_clip(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: a clip is chosen."""
    return is_met(cls, context.scene.virtual_aperture.footage, "Choose a clip first")


def has_solve(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: the scene holds a solved clip."""
    return is_met(cls, context.scene.virtual_aperture.points is not None, "Solve the clip first")


def has_focus(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: the scene holds a solved clip and something is in focus."""
    settings = context.scene.virtual_aperture
    message = "Pick what should be sharp first, with Pick Focus"
    return has_solve(cls, context) and is_met(cls, is_in_focus(settings), message)


def has_points(cls: Any, context: bpy.types.Context, to_do: str) -> bool:
    """Poll for a selection in the point cloud; `to_do` names it."""
    if not may_change(cls, context) or not has_solve(cls, context):
        return False
    points = context.scene.virtual_aperture.points
    if points.mode == "EDIT":
        return True
    if not parts.is_in(context.scene, points):
        cls.poll_message_set("The point cloud was deleted; Restore Objects, at the top, brings it back")
    elif points.name not in context.view_layer.objects:
        cls.poll_message_set("The point cloud's collection is excluded from the view layer")
    else:
        cls.poll_message_set(f"Select the point cloud, press Tab for Edit Mode and select {to_do}")
    return False


def refused(error: RuntimeError) -> UserError:
    """Return the error of an operator called from Python."""
    return UserError(str(error).removeprefix("Error: ").strip())


def reported(
    execute: Callable[[Any, bpy.types.Context], Result],
) -> Callable[[Any, bpy.types.Context], Result]:
    """Return a UserError becomes the operator's error report, which scripts see as RuntimeError."""

    def wrapped(self: Any, context: bpy.types.Context) -> Result:
        try:
            return execute(self, context)
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}

    return wrapped


def is_kept(settings: Any) -> bool:
    """Return whether the working folder has a solve or an import; fast enough for drawing."""
    return bool(settings.footage) and (work_dir(settings, footage_path(settings)) / STATE).exists()


def build_scene(scene: bpy.types.Scene, footage: Footage, folder: Path) -> tuple[Solve, str]:
    """Build the solve of a working folder into a scene.

    Returns:
        The solve, and a note on its focus, or "".
    """
    solve = load_solve(folder, footage.path)
    kept = keep_focus(scene.virtual_aperture, footage.path)
    points = scene.virtual_aperture.points
    if points is not None and points.mode == "EDIT":
        # A mesh cannot be filled there. The window may show another scene meanwhile.
        layer = scene.view_layers[0]
        with bpy.context.temp_override(scene=scene, view_layer=layer, active_object=points):
            bpy.ops.object.mode_set(mode="OBJECT")
    settings = build(scene, footage, solve.reconstruction)
    settings.summary = solve.summary
    settings.advice = with_words(solve.quality.advice, solve.quality.remedies, WORDS)
    note = ""
    if kept is not None:
        note = restore_focus(settings, kept, solve.reconstruction)
    else:
        # So that the first render shows the effect.
        focus_marks.set_first(settings, solve.reconstruction)
    aperture_cloud.update(settings)
    after_solve.show(scene, solve.reconstruction)
    return solve, note


def kept_words(folder: Path) -> str:
    """Return the content of a working folder in a line, for a question before it is replaced."""
    made = time.strftime("%d %B %Y, %H:%M", time.localtime((folder / STATE).stat().st_mtime))
    try:
        quality, kind = load_solve(folder).quality, imported_from(folder) or "Solve"
    except UserError:
        # Its clip is gone, or it is damaged.
        return f"Solve of {made}"
    registered = f"{quality.registered} of {quality.frames} frames"
    return f"{kind} of {made}: {registered}, {counted(quality.points, 'point')}"


def solved_words(scene: bpy.types.Scene, summary: str) -> str:
    """Return the result of a solve, and the focus, in one line."""
    settings = scene.virtual_aperture
    if not settings.marks.is_first:
        return summary
    return f"{summary}; focused on {first_person.in_focus(settings)}. Pick Focus changes that"


def focus_on_person(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Put the nearest subject in focus where nobody has picked a focus, as `first_person.focus`."""
    try:
        first_person.focus(scene)
    except UserError as error:
        operator.report({"WARNING"}, f"People were not looked for: {error.worded(WORDS)}")


def report_hidden(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Say what was hidden for the camera, if anything."""
    if things := after_solve.still_hidden(scene):
        operator.report({"INFO"}, after_solve.hidden_words(things))


class Solves:
    """Solve a clip, with ESC to cancel, and bring it into the scene as one undo step.

    Until then the scene is not touched.
    """

    bl_options = {"UNDO"}  # noqa: RUF012

    again = False
    _process: Solving | None = None
    _timer: bpy.types.Timer | None = None
    _scene = ""
    _folder_set = ""
    _depth: Path | None = None
    _cameras: Imported | None = None
    """Cameras that are known and held; None where they are to be found, too."""

    def solved_clip(self, settings: Any) -> tuple[Path, str]:
        """Return the clip to solve, and the settings' working folder."""
        raise NotImplementedError

    def _start(self, context: bpy.types.Context) -> Solving:
        settings = context.scene.virtual_aperture
        clip, self._folder_set = self.solved_clip(settings)
        # It also looks into the folder that is about to change.
        self._depth = depth_ahead.give_way()
        # The user may go to another scene meanwhile.
        self._scene = context.scene.name
        return Solving(
            partial(
                SolveProcess,
                clip,
                work_dir(settings, clip, self._folder_set),
                focal=focal_of(settings),
                again=self.again,
                zooms=settings.lens == "ZOOM",
                yielding=not bpy.app.background,
                cameras=self._cameras,
                stills=settings.stills and (clip.is_dir() or is_pattern(clip)),
                depth_maps=absolute(settings.depth_maps, context.scene) if settings.depth_maps else None,
            ),
            clip.name,
        )

    def solve_now(self, context: bpy.types.Context) -> Result:
        """Solve, and wait for the result; UserError as the core's."""
        solving = self._process = self._start(context)
        try:
            while not solving.finished:
                solving.poll()
                time.sleep(LOOK)
        finally:
            solving.cancel()
        return self._finish()

    def solve_meanwhile(self: Any, context: bpy.types.Context) -> Result:
        """Begin to solve; `modal` goes on. UserError where it cannot begin."""
        self._process = VIRTUAL_APERTURE_OT_solve._running = self._start(context)
        manager = context.window_manager
        self._timer = manager.event_timer_add(LOOK, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        redraw.panels()
        return {"RUNNING_MODAL"}

    def modal(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        assert self._process is not None
        if event.type == "ESC":
            self._end(context)
            depth_ahead.begin_after_solve(self._depth)
            self.report({"WARNING"}, "Solve cancelled; nothing was changed")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            before = self._process.sight, self._process.step.stage
            for step in self._process.poll():
                context.window_manager.progress_update(100 * step.share)
                context.workspace.status_text_set(f"Virtual Aperture: {step.text}    (ESC cancels)")
                redraw.panels()
            if (self._process.sight, self._process.step.stage) != before:
                redraw.viewports()
            if not self._process.finished:
                return {"RUNNING_MODAL"}
            self._end(context)
            result: Result = self._finish()
            return result
        except UserError as error:
            self._end(context)
            depth_ahead.begin_after_solve(self._depth)
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}
        except Exception:
            # Else the worker would go on, and the folder stay locked, without anybody to end it.
            self._end(context)
            raise

    def cancel(self, _context: bpy.types.Context) -> None:
        """Called by Blender when another file is loaded meanwhile, or the question is answered by no."""
        if self._process is not None:
            self._process.cancel()

    def _finish(self: Any) -> Result:
        assert self._process is not None and self._process.process is not None
        process, scene = self._process.process, bpy.data.scenes.get(self._scene)
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
        self.report({"INFO"}, solved_words(scene, solve.summary))
        return {"FINISHED"}

    def _end(self, context: bpy.types.Context) -> None:
        assert self._process is not None
        self._process.cancel()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            self._timer = None
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        redraw.viewports()


class VIRTUAL_APERTURE_OT_solve(Solves, bpy.types.Operator):  # noqa: N801
    """Find the clip's camera motion and feature points, and add them to the scene"""

    bl_idname = "virtual_aperture.solve"
    bl_label = "Solve Clip"
    # Not REGISTER: its redo panel would solve once more, with the interface frozen.

    again: bpy.props.BoolProperty(
        name="Solve Again",
        description="Solve even if the working folder already holds a solve",
        options={"SKIP_SAVE"},
    )
    sure: bpy.props.BoolProperty(
        name="Do Not Ask", description="The user has confirmed", options={"SKIP_SAVE", "HIDDEN"}
    )

    _running: Solving | None = None
    """Class attribute: the present solve in this Blender."""
    _asks = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return is_idle(cls) and may_change(cls, context) and has_clip(cls, context)

    def solved_clip(self, settings: Any) -> tuple[Path, str]:
        return footage_path(settings), settings.work_dir

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        if self._asks:
            # The answer to the question comes here; the work is for the modal operator.
            bpy.ops.virtual_aperture.solve("INVOKE_DEFAULT", again=True, sure=True)
            return {"CANCELLED"}
        return self.solve_now(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if bpy.app.background:
            return self.execute(context)
        settings = context.scene.virtual_aperture
        if self.again and not self.sure and is_kept(settings):
            self._asks = True
            folder = work_dir(settings, footage_path(settings))
            answer: Result = context.window_manager.invoke_confirm(
                self, event, title=f"Replace the solve in {folder.name}?", message=kept_words(folder),
                confirm_text="Solve Again",
            )  # fmt: skip
            return answer
        return reported(VIRTUAL_APERTURE_OT_solve.solve_meanwhile)(self, context)


def running_solve() -> Solving | None:
    """Return the solve that is under way in this Blender."""
    running = VIRTUAL_APERTURE_OT_solve._running
    return None if running is None or running.ended else running


def end_solve() -> None:
    """End the solve that is under way, if there is one; the folder stays as it was."""
    if (running := running_solve()) is not None:
        running.cancel()
    VIRTUAL_APERTURE_OT_solve._running = None


CLASSES = (VIRTUAL_APERTURE_OT_solve,)
