"""Rendering the solved clip: with Blender's own render job, or as a movie."""

import time
from pathlib import Path
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...core.base.file_names import checked_name
from ...render.views.frame_size import render_size, shape_problem
from ...scene import parts
from ...scene.base import redraw
from ...scene.lens.lens import frame_options
from ...scene.sources.clip import solved_clip_path
from ...scene.sources.shot import picture_size, reconstruction_of
from ..base import operators
from ..base.operators import Acts, Edits, Result, has_focus, has_solve, is_met, may_change, polls, requires
from . import depth_ahead, movie
from .movie import MovieJob


def can_render(cls: Any, context: bpy.types.Context) -> bool:
    """Poll: something is in focus and the scene has a camera, without which Blender renders nothing."""
    scene = context.scene
    is_there = any(parts.is_in(scene, camera) for camera in (scene.camera, scene.virtual_aperture.camera))
    return has_focus(cls, context) and is_met(cls, is_there, operators.NO_CAMERA)


def prepare_render(scene: bpy.types.Scene) -> None:
    """Have Blender render with our engine; UserError where the settings mean nothing."""
    settings = scene.virtual_aperture
    frame_options(settings, reconstruction_of(settings))
    scene.render.engine = "VIRTUAL_APERTURE"
    # Whichever camera it is: the picture is the clip's.
    scene.camera = scene.camera or settings.camera


def check_output_path(scene: bpy.types.Scene) -> None:
    """Refuse an output path with backslashes, unless it is beside the .blend, as on Windows."""
    output = scene.render.filepath
    checked_name(Path(bpy.data.filepath if output.startswith("//") else output).absolute())


def output_problem(scene: bpy.types.Scene) -> str:
    """Explain why the clip cannot be rendered at the size of the scene's output, which has another shape.

    It is empty if the clip can be rendered, and without a clip.
    """
    try:
        return shape_problem(render_size(scene.render), picture_size(scene))
    except UserError:
        return ""


class VIRTUAL_APERTURE_OT_use_clip_size(Edits, bpy.types.Operator):  # noqa: N801
    """Set the output resolution to the clip's. The percentage stays"""

    poll = polls(may_change, has_solve)

    def act(self, context: bpy.types.Context) -> None:
        render = context.scene.render
        render.resolution_x, render.resolution_y = picture_size(context.scene)


class _Render(Acts):
    """Common code of the two render operators."""

    animation = False

    poll = polls(can_render)

    def act(self, context: bpy.types.Context) -> None:
        prepare_render(context.scene)
        if self.animation:
            check_output_path(context.scene)
        solved_clip_path(context.scene.virtual_aperture)
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        try:
            bpy.ops.render.render(how, animation=self.animation, use_viewport=True)
        except RuntimeError as error:
            raise operators.refused(error) from None


class VIRTUAL_APERTURE_OT_render_frame(_Render, bpy.types.Operator):  # noqa: N801
    """Render the current frame with depth of field"""


class VIRTUAL_APERTURE_OT_render_clip(_Render, bpy.types.Operator):  # noqa: N801
    """Render all frames of the scene's range with depth of field: as a movie with the clip's sound, or as
    frames to the scene's output"""

    animation = True

    overwrite: bpy.props.BoolProperty(
        name="Overwrite", description="Replace the movie if it exists", options={"SKIP_SAVE"}
    )

    _asks = False
    _movie: MovieJob | None = None
    _timer: bpy.types.Timer | None = None
    _depth: Any = None

    poll = polls(requires(lambda _: MovieJob.under_way() is None, "A movie is being rendered"), can_render)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if bpy.app.background or context.scene.virtual_aperture.render_as == "FRAMES":
            return self.execute(context)
        out = movie.movie_path(context.scene)
        if out.is_file() and not self.overwrite:
            self._asks = True
            title, message = f"Replace {out.name}?", str(out.parent)
            return operators.asked(self, context, event, title=title, message=message, confirm_text="Replace")
        return operators.reported(VIRTUAL_APERTURE_OT_render_clip._meanwhile)(self, context)

    def execute(self, context: bpy.types.Context) -> Result:
        if context.scene.virtual_aperture.render_as == "FRAMES":
            return super().execute(context)
        if self._asks:
            # The answer to the question comes here; the work is for the modal operator.
            self.once_more(overwrite=True)
            return {"CANCELLED"}
        return operators.reported(VIRTUAL_APERTURE_OT_render_clip._now)(self, context)

    def _begin(self, scene: bpy.types.Scene) -> MovieJob:
        settings = scene.virtual_aperture
        frame_options(settings, reconstruction_of(settings))
        check_output_path(scene)
        solved_clip_path(settings)
        made = self._movie = movie.begin(scene, movie.movie_path(scene), self.overwrite)
        self._depth = depth_ahead.give_way()
        return made

    def _now(self, context: bpy.types.Context) -> Result:
        made = self._begin(context.scene)
        try:
            while made.is_running:
                made.poll()
                time.sleep(operators.LOOK)
        finally:
            made.leave(made.clear)
        return self._finish(context)

    def _meanwhile(self, context: bpy.types.Context) -> Result:
        self._begin(context.scene)
        self._timer = context.window_manager.event_timer_add(operators.LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        redraw.panels()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type != "TIMER" or self._movie is None:
            return {"PASS_THROUGH"}
        if self._movie.poll():
            redraw.panels()
        if self._movie.is_running:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        redraw.panels()
        return operators.reported(VIRTUAL_APERTURE_OT_render_clip._finish)(self, context)

    def cancel(self, _context: bpy.types.Context) -> None:
        """End the movie, but keep its finished frames: Blender closes, or loads another file."""
        if self._movie is not None:
            self._movie.leave()

    def _finish(self, _context: bpy.types.Context) -> Result:
        assert self._movie is not None
        depth_ahead.begin_after_solve(self._depth)
        for warning in self._movie.warnings:
            self.report({"WARNING"}, warning)
        if self._movie.failure is not None:
            raise self._movie.failure.error
        if self._movie.is_cancelled:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {self._movie.out}")
        return {"FINISHED"}
