"""The clip as a movie with sound, rendered by another process from a copy of the file.

The user can continue to work, and output settings of the scene are not touched.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any, ClassVar

import bpy

from ...core.base.errors import UserError
from ...core.base.worker import Worker
from ...core.media.picture_file import PICTURES
from ...render.output import movie_folder
from ...render.output.movie_file import JOINING, MOVIES, check_rate
from ...render.output.output import STILLS, check_output, claimed
from ...render.processes.launcher import start, write_blend
from ...scene.base.paths import absolute
from ...scene.base.timeline import clip_frame
from ...scene.sources.clip import footage_path
from ..base.operators import Named, Result, polls, requires
from ..base.text import progress_row

ENDING = "_render"
"""Suffix of a movie's name after the clip's: the clip may lie beside it."""


class MovieJob(Worker):
    """The process that renders a movie."""

    last: ClassVar[MovieJob | None] = None
    """The last one of this Blender: there are not two at once, as each takes as many processes as fit."""

    def __init__(self, out: Path) -> None:
        super().__init__()
        self.out = out

    @property
    def words(self) -> str:
        """How far it is, in a few words."""
        if self.stage == JOINING:
            return "Writing the movie"
        return f"Movie: {self.done} of {self.total} frames" if self.done else self.stage or "Starting Blender"

    @property
    def name(self) -> str:
        """Its name in a sentence."""
        return f"the movie {self.out.name}"

    def clear(self) -> None:
        """Remove what the process, which has ended, leaves unfinished."""
        # Another run may have begun with the same movie.
        with contextlib.suppress(UserError), claimed(self.out):
            movie_folder.clear(self.out)
        with contextlib.suppress(OSError):
            self.out.parent.rmdir()  # where it holds nothing

    @classmethod
    def under_way(cls) -> MovieJob | None:
        """Return the one that runs."""
        return cls.last if cls.last is not None and cls.last.is_running else None

    @classmethod
    def stop(cls) -> None:
        """End the one that runs, and forget the last one."""
        if cls.last is not None:
            cls.last.leave(cls.last.clear)
        cls.last = None

    def draw(self, layout: bpy.types.UILayout, cancel: str) -> None:
        """Draw the progress, with the operator that cancels it."""
        progress_row(layout, self.words, self.share, self.left, cancel)


def movie_path(scene: bpy.types.Scene) -> Path:
    """Return the path of the scene's movie by the output path.

    It is that path if it names a movie; a file beside the folder that a solve has set for frames; else a file
    there, under the same name.
    """
    output, settings = scene.render.filepath, scene.virtual_aperture
    folder = Path(bpy.path.abspath(scene.render.frame_path(frame=scene.frame_start))).parent
    name = "" if output.endswith(("/", os.sep)) else Path(output.replace("\\", "/")).name
    suffix = Path(name).suffix.lower()
    if suffix in MOVIES:
        return absolute(str(folder / name))
    if output == settings.output and not name:
        return absolute(f"{folder}.mp4")
    name = name.removesuffix(Path(name).suffix) if suffix in {*PICTURES, *STILLS} else name
    name = _without_number(name)
    if not name or "{" in name or "#" in name:
        name = f"{_without_number(footage_path(settings).stem)}{ENDING}"
    return absolute(str(folder / f"{name}.mp4"))


def _without_number(name: str) -> str:
    """The part of a name before its ####."""
    return name.rstrip("#").rstrip("_-. ")


def begin(scene: bpy.types.Scene, out: Path, overwrite: bool) -> MovieJob:
    """Render the scene's frames as a movie in another process.

    Raises:
        UserError: It cannot be started, or would replace a file unasked.
    """
    check_output(out, overwrite)
    first, last = (clip_frame(scene, at) for at in (scene.frame_start, scene.frame_end))
    check_rate(out, scene, range(first, last + 1))
    made = MovieJob(out)
    blend = made.folder / "scene.blend"
    write_blend(blend)
    words = ["render", blend, "--out", out, "--frames", f"{first}-{last}", *["--overwrite"] * overwrite]
    start(made, words, scene.name, as_is=True)
    MovieJob.last = made
    return made


def draw(layout: bpy.types.UILayout) -> None:
    """Draw the progress of a movie with a button to cancel it, or a finished movie with one to play."""
    made, scene = MovieJob.last, bpy.context.scene
    if made is None:
        return
    if made.is_running:
        made.draw(layout, VIRTUAL_APERTURE_OT_cancel_movie.bl_idname)
        return
    is_of_clip = bool(scene.virtual_aperture.footage) and made.out == movie_path(scene)
    if made.failure is None and is_of_clip and made.out.exists():
        row = layout.row(align=True)
        row.label(text=made.out.name, icon="CHECKMARK")
        row.operator("wm.path_open", text="", icon="PLAY").filepath = str(made.out)


class Cancels(Named):
    """An operator that cancels a job."""

    job: type[MovieJob]
    said: str
    """A line for the user."""

    def execute(self: Any, _context: bpy.types.Context) -> Result:
        self.job.stop()
        self.report({"WARNING"}, self.said)
        return {"FINISHED"}


class VIRTUAL_APERTURE_OT_cancel_movie(Cancels, bpy.types.Operator):  # noqa: N801
    """End rendering the movie. Nothing of it is kept"""

    job, said = MovieJob, "The movie was cancelled; nothing was written"

    poll = polls(requires(lambda _: MovieJob.under_way(), "No movie is being rendered"))
