"""The steps of the work, each an operator."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import bpy

from ..core.base.counting import counted
from ..core.base.errors import UserError, with_words
from ..core.base.progress import Cancelled, reporting
from ..core.media.clip import Footage
from ..core.sfm.process import Progress, SolveProcess
from ..core.sfm.state import STATE
from ..core.sfm.workspace import Solve, imported_from, load_solve
from ..scene import aperture_cloud, focus_marks
from ..scene.build import build
from ..scene.clip import footage_path, solved_clip_path, work_dir
from ..scene.lens import focal_of, is_in_focus, lens_settings
from ..scene.refocus import keep_focus, restore_focus
from ..scene.remedy_words import WORDS
from ..scene.shot import reconstruction_of
from . import after_solve, depth_ahead

Result = set[str]

LOOK = 0.1
"""Seconds between two looks at the solving process."""


def has_clip(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: a clip is chosen."""
    if context.scene.virtual_aperture.footage:
        return True
    cls.poll_message_set("Choose a clip first")
    return False


def has_solve(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: the scene holds a solved clip."""
    if context.scene.virtual_aperture.points is not None:
        return True
    cls.poll_message_set("Solve the clip first")
    return False


def has_focus(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: the scene holds a solved clip and something is in focus."""
    settings = context.scene.virtual_aperture
    if not has_solve(cls, context):
        return False
    if is_in_focus(settings):
        return True
    cls.poll_message_set("Pick what is to be sharp first: Pick Focus")
    return False


def reported(
    execute: Callable[[Any, bpy.types.Context], Result],
) -> Callable[[Any, bpy.types.Context], Result]:
    """A UserError becomes the operator's error report, which scripts see as RuntimeError."""

    def wrapped(self: Any, context: bpy.types.Context) -> Result:
        try:
            return execute(self, context)
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}

    return wrapped


def is_kept(settings: Any) -> bool:
    """Whether the clip's working folder keeps a solve or an import; for drawing, so nothing is read."""
    return bool(settings.footage) and (work_dir(settings, footage_path(settings)) / STATE).exists()


def build_scene(scene: bpy.types.Scene, footage: Footage, folder: Path) -> tuple[Solve, str]:
    """Build the solve of the clip that a working folder keeps into a scene; what became of its focus, if that
    is worth saying."""
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
    """What a working folder keeps, in a line, for who is about to replace it."""
    made = time.strftime("%d %B %Y, %H:%M", time.localtime((folder / STATE).stat().st_mtime))
    try:
        quality, kind = load_solve(folder).quality, imported_from(folder) or "Solve"
    except UserError:
        # Its clip is gone, or it is damaged.
        return f"Solve of {made}"
    registered = f"{quality.registered} of {quality.frames} frames"
    return f"{kind} of {made}: {registered}, {counted(quality.points, 'point')}"


def solved_words(scene: bpy.types.Scene, summary: str) -> str:
    """One line of what was solved, and what was put in focus."""
    first = "; the nearest large thing round the middle is in focus: Pick Focus sets another"
    return summary + (first if scene.virtual_aperture.marks.is_first else "")


def report_hidden(operator: bpy.types.Operator, scene: bpy.types.Scene) -> None:
    """Say what was hidden for the camera, if anything."""
    if names := after_solve.still_hidden(scene):
        operator.report({"INFO"}, after_solve.hidden_words(names))


class _Solving:
    """A solve from its first moment on: the clip is opened and its frames counted, which takes seconds, in
    a thread, so that the interface goes on meanwhile and ESC ends it."""

    def __init__(self, begin: Callable[[], SolveProcess]) -> None:
        """`begin` makes the process; it must not touch Blender's data."""
        self.process: SolveProcess | None = None
        self.ended = False
        self.step = Progress("Reading the clip", 0.0)
        """How far it is."""
        self._error: BaseException | None = None
        self._cancelled = threading.Event()
        self._opening = threading.Thread(target=self._open, args=(begin,), daemon=True)
        self._opening.start()

    def _open(self, begin: Callable[[], SolveProcess]) -> None:
        try:
            with reporting(self._on_progress):
                self.process = begin()
        except BaseException as error:  # raised again where the solve is waited for
            self._error = error

    def _on_progress(self, _stage: str, _share: float) -> None:
        if self._cancelled.is_set():
            raise Cancelled

    @property
    def finished(self) -> bool:
        """Whether the folder holds the solve."""
        return self.process is not None and self.process.finished

    def poll(self) -> list[Progress]:
        """As `SolveProcess.poll`; also raises what opening the clip raised."""
        if self._opening.is_alive():
            return [self.step]
        if self._error is not None:
            self.ended = True
            raise self._error
        assert self.process is not None
        steps = self.process.poll()
        self.step = steps[-1] if steps else self.step
        return steps

    def cancel(self) -> None:
        """End what is under way and leave the folder as it was; harmless after the end."""
        self._cancelled.set()
        self._opening.join()
        if self.process is not None:
            self.process.cancel()
        self.ended = True


class VIRTUAL_APERTURE_OT_solve(bpy.types.Operator):  # noqa: N801
    """Find the cameras and the feature points of the clip, and bring them into the scene"""

    bl_idname = "virtual_aperture.solve"
    bl_label = "Solve Clip"
    # Not REGISTER: its redo panel would solve once more, with the interface frozen.
    bl_options = {"UNDO"}  # noqa: RUF012

    again: bpy.props.BoolProperty(
        name="Solve Again",
        description="Solve even where the working folder holds a solve",
        options={"SKIP_SAVE"},
    )
    sure: bpy.props.BoolProperty(
        name="Do Not Ask", description="The user was asked", options={"SKIP_SAVE", "HIDDEN"}
    )

    _running: _Solving | None = None
    """Of the class: the solve that is under way in this Blender."""
    _asks = False
    _process: _Solving | None = None
    _timer: bpy.types.Timer | None = None
    _scene = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if running_solve() is not None:
            cls.poll_message_set("A clip is being solved; ESC cancels it")
            return False
        return has_clip(cls, context)

    def _start(self, context: bpy.types.Context) -> _Solving:
        settings = context.scene.virtual_aperture
        # It looks into the folder that is about to change.
        depth_ahead.stop()
        # The user may go to another scene meanwhile.
        self._scene = context.scene.name
        return _Solving(
            partial(
                SolveProcess,
                footage_path(settings),
                work_dir(settings, footage_path(settings)),
                focal=focal_of(settings),
                again=self.again,
                zooms=settings.lens == "ZOOM",
            )
        )

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        if self._asks:
            # The answer to the question comes here; the work is for the modal operator.
            bpy.ops.virtual_aperture.solve("INVOKE_DEFAULT", again=True, sure=True)
            return {"CANCELLED"}
        solving = self._process = self._start(context)
        try:
            while not solving.finished:
                solving.poll()
                time.sleep(LOOK)
        finally:
            solving.cancel()
        return self._finish()

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
        try:
            self._process = VIRTUAL_APERTURE_OT_solve._running = self._start(context)
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(LOOK, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        _redraw(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        assert self._process is not None
        if event.type == "ESC":
            self._end(context)
            self.report({"WARNING"}, "Solving was cancelled; the scene is as it was")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            for step in self._process.poll():
                context.window_manager.progress_update(100 * step.share)
                context.workspace.status_text_set(f"Virtual Aperture: {step.text}    (ESC cancels)")
                _redraw(context)
            if not self._process.finished:
                return {"RUNNING_MODAL"}
            self._end(context)
            return self._finish()
        except UserError as error:
            self._end(context)
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

    def _finish(self) -> Result:
        assert self._process is not None and self._process.process is not None
        process, scene = self._process.process, bpy.data.scenes.get(self._scene)
        if scene is None:
            raise UserError(f"the scene {self._scene!r} is gone; the solve is kept in {process.work_dir}")
        solve, note = build_scene(scene, process.clip, process.work_dir)
        depth_ahead.begin_after_solve(process.work_dir)
        report_hidden(self, scene)
        if note:
            self.report({"WARNING"}, note)
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
        _redraw(context)


def running_solve() -> _Solving | None:
    """The solve that is under way in this Blender."""
    running = VIRTUAL_APERTURE_OT_solve._running
    return None if running is None or running.ended else running


def _redraw(context: bpy.types.Context) -> None:
    """Let panels show how far a solve is, and buttons whether they can be pressed now."""
    for area in context.screen.areas:
        area.tag_redraw()


class _Render:
    """What the two render operators share."""

    animation = False

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_focus(cls, context)

    def execute(self, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        try:
            lens_settings(settings, reconstruction_of(settings))
            solved_clip_path(settings)
        except UserError as error:
            self.report({"ERROR"}, error.worded(WORDS))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        context.scene.render.engine = "VIRTUAL_APERTURE"
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        bpy.ops.render.render(how, animation=self.animation, use_viewport=True)
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_render_frame(_Render, bpy.types.Operator):  # noqa: N801
    """Render the current frame with depth of field"""

    bl_idname = "virtual_aperture.render_frame"
    bl_label = "Render Frame"


class VIRTUAL_APERTURE_OT_render_clip(_Render, bpy.types.Operator):  # noqa: N801
    """Render all frames of the scene's range with depth of field, to the scene's output"""

    bl_idname = "virtual_aperture.render_clip"
    bl_label = "Render Clip"
    animation = True


CLASSES = (
    VIRTUAL_APERTURE_OT_solve,
    VIRTUAL_APERTURE_OT_render_frame,
    VIRTUAL_APERTURE_OT_render_clip,
)
