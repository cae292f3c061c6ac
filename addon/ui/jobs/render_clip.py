"""Rendering the solved clip: with Blender's own render job, or as a movie."""

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
from ..base.meanwhile import Meanwhile
from ..base.operators import Acts, Edits, Result, each_of, has_focus, has_solve, may_change, polls, requires
from . import depth_ahead, movie
from .movie import MovieJob

has_camera = requires(
    lambda c: any(parts.is_in(c.scene, each) for each in (c.scene.camera, c.scene.virtual_aperture.camera)),
    operators.NO_CAMERA,
)
can_render = each_of(has_focus, has_camera)
"""Polls: the scene has a camera, without which Blender renders nothing; something is in focus, too."""


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


class VIRTUAL_APERTURE_OT_render_clip(Meanwhile, _Render, bpy.types.Operator):  # noqa: N801
    """Render all frames of the scene's range with depth of field: as a movie with the clip's sound, or as
    frames to the scene's output"""

    animation = True
    sure_by = "overwrite"

    overwrite: bpy.props.BoolProperty(
        name="Overwrite", description="Replace the movie if it exists", options={"SKIP_SAVE"}
    )

    _movie: MovieJob
    _depth: Path | None = None

    poll = polls(requires(lambda _: MovieJob.under_way() is None, "A movie is being rendered"), can_render)

    def question(self, context: bpy.types.Context) -> dict[str, str]:
        out = movie.movie_path(context.scene)
        if self.overwrite or not out.is_file():
            return {}
        return {"title": f"Replace {out.name}?", "message": str(out.parent), "confirm_text": "Replace"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if context.scene.virtual_aperture.render_as == "FRAMES":
            return self.execute(context)
        return super().invoke(context, event)

    def execute(self, context: bpy.types.Context) -> Result:
        is_movie = context.scene.virtual_aperture.render_as == "MOVIE"
        return super().execute(context) if is_movie else _Render.execute(self, context)

    def begin(self, context: bpy.types.Context) -> None:
        scene, settings = context.scene, context.scene.virtual_aperture
        frame_options(settings, reconstruction_of(settings))
        check_output_path(scene)
        solved_clip_path(settings)
        self._movie = movie.begin(scene, movie.movie_path(scene), self.overwrite)
        self._depth = depth_ahead.give_way()

    def look(self) -> bool:
        if self._movie.poll():
            redraw.panels()
        return not self._movie.is_running

    def end(self) -> None:
        # In a window Blender closes, or loads another file: finished frames are kept.
        self._movie.leave(self._movie.clear if bpy.app.background else None)

    def conclude(self: Any) -> Result:
        depth_ahead.begin_after_solve(self._depth)
        for warning in self._movie.warnings:
            self.report({"WARNING"}, warning)
        if self._movie.failure is not None:
            raise self._movie.failure.error
        if self._movie.is_cancelled:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {self._movie.out}")
        return {"FINISHED"}
