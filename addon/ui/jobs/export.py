"""Export: files for other programs, made by another process from a copy of the file."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import ClassVar

import bpy

from ...core.base.atomic import collect_orphans
from ...core.base.errors import UserError
from ...render.output import export as exports
from ...render.processes.launcher import start, write_blend
from ...scene.base import redraw
from ...scene.base.events import watch
from ...scene.base.paths import absolute
from ...scene.base.remedy_words import WORDS
from ...scene.lens.lens import frame_options
from ...scene.sources.clip import footage_path, solved_clip_path, work_dir
from ...scene.sources.shot import reconstruction_of, shot_of
from ..base.operators import Acts, Result, has_focus, has_solve, polls, requires, sentence
from ..base.text import wrapped
from . import depth_ahead, movie
from .depth_ahead import LOOK

FOLDER = "export"
"""Suggested, beside what Render Clip writes."""


class ExportJob(movie.MovieJob):
    """The process that writes the files of an export into the folder `out`."""

    last: ClassVar[ExportJob | None] = None  # type: ignore[misc]
    depth: Path | None = None
    """The working folder whose depth was being found before."""

    @property
    def words(self) -> str:
        """How far it is, in a few words."""
        return f"Export: {self.done} of {self.total} files" if self.total else "Export: starting"

    @property
    def name(self) -> str:
        """Its name in a sentence."""
        return f"the export to {self.out.name}"

    def clear(self) -> None:
        """Remove what the process, which has ended, leaves unfinished; whole files stay."""
        collect_orphans(self.out)
        with contextlib.suppress(OSError):
            self.out.rmdir()  # where it holds nothing


def begin(scene: bpy.types.Scene, what: str, folder: Path, overwrite: bool) -> ExportJob:
    """Export the frames of the scene's range in another process.

    Raises:
        UserError: It cannot be started, or would replace files unasked.
    """
    frames = [each for each in shot_of(scene).footage.frames if scene.frame_start <= each <= scene.frame_end]
    if not frames:
        raise UserError("the scene's range holds none of the clip's frames; set Frame Start and End to some")
    exports.check_free(exports.planned(scene, what, frames, folder), overwrite)
    made = ExportJob(folder)
    blend = made.folder / "scene.blend"
    write_blend(blend)
    words = ["export", blend, "--what", what, "--out", folder, *["--overwrite"] * overwrite]
    words += ["--frames", f"{frames[0]}-{frames[-1]}"]
    start(made, words, scene.name)
    made.depth = depth_ahead.give_way()
    ExportJob.last = made
    return made


def _tick() -> float | None:
    """A timer's turn: panels show how far it is; None when it has ended."""
    made = ExportJob.last
    if made is None:
        return None
    if made.poll() or not made.is_running:
        redraw.panels()
    if made.is_running:
        return LOOK
    settings = bpy.context.scene.virtual_aperture
    # Another file may have been opened since.
    if settings.footage and work_dir(settings, footage_path(settings)) == made.depth:
        depth_ahead.begin_after_solve(made.depth)
    return None


def draw(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the button, or the progress with a button to cancel; and the result of the last export."""
    made = ExportJob.last
    if made is not None and made.is_running:
        made.draw(layout, VIRTUAL_APERTURE_OT_cancel_export.bl_idname)
        return
    layout.operator(VIRTUAL_APERTURE_OT_export.bl_idname, icon="EXPORT")
    if made is None:
        return
    if made.failure is not None:
        wrapped(layout, context, sentence(made.failure.error.worded(WORDS)), icon="ERROR")
    elif made.out.is_dir():
        row = layout.row(align=True)
        row.label(text=f"Exported to {made.out.name}", icon="CHECKMARK")
        row.operator("wm.path_open", text="", icon="FILE_FOLDER").filepath = str(made.out)


class VIRTUAL_APERTURE_OT_export(Acts, bpy.types.Operator):  # noqa: N801
    """Write files for other programs: frames of the scene's range in two layers, or STMaps of the lens"""

    bl_label = "Export..."

    directory: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", options={"SKIP_SAVE"})
    what: bpy.props.EnumProperty(
        name="Export", description="What the files hold",
        items=[(name, *words) for name, words in exports.WHAT.items()],
    )  # fmt: skip
    overwrite: bpy.props.BoolProperty(
        name="Overwrite", description="Replace files that exist", options={"SKIP_SAVE"}
    )

    poll = polls(requires(lambda _: ExportJob.under_way() is None, "Files are being exported"), has_solve)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        if context.scene.virtual_aperture.footage:
            self.directory = str(movie.movie_path(context.scene).parent / FOLDER)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> str | None:
        scene, settings = context.scene, context.scene.virtual_aperture
        if not self.directory:
            raise UserError("no folder has been chosen; choose one for the files")
        solved_clip_path(settings)
        if self.what == exports.LAYERS:
            if not has_focus(type(self), context):
                raise UserError("nothing is in focus, so the extent of the layers is unknown; use Pick Focus")
            frame_options(settings, reconstruction_of(settings))
        made = begin(scene, self.what, absolute(self.directory), self.overwrite)
        if not bpy.app.background:
            # It goes on where another file is opened.
            watch(_tick, LOOK, stays=True)
            return None
        while _tick() is not None:
            time.sleep(LOOK)
        if made.failure is not None:
            raise made.failure.error
        return f"Exported to {made.out}"


class VIRTUAL_APERTURE_OT_cancel_export(movie.Cancels, bpy.types.Operator):  # noqa: N801
    """End the export. Files that are complete are kept"""

    job, said = ExportJob, "The export was cancelled; complete files are kept"

    poll = polls(requires(lambda _: ExportJob.under_way(), "Nothing is being exported"))
