"""Operators that take in what another program, or Blender's own tracker, solved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..core.base.errors import UserError
from ..core.media.clip import Footage, open_footage
from ..core.readers import read_reconstruction
from ..core.readers.matching import Imported
from ..core.sfm.workspace import SolveThereError, keep_import
from ..scene.clip import footage_path, work_dir
from ..scene.movieclip import read_movie_clip
from . import depth_ahead
from .operators import (
    Result,
    build_scene,
    has_clip,
    is_met,
    may_change,
    report_hidden,
    reported,
    solved_words,
)


class Import:
    """Read, keep in the working folder, bring into the scene; a solve that is there is only replaced when the
    user was asked."""

    bl_options = {"UNDO"}  # noqa: RUF012

    again: bpy.props.BoolProperty(
        name="Replace",
        description="Replace a solve of the clip that is in the working folder",
        options={"SKIP_SAVE", "HIDDEN"},
    )

    _asks = False

    def read(self, footage: Footage) -> Imported:
        """What is to be imported; UserError where it cannot be."""
        raise NotImplementedError

    def ask(self) -> None:
        """Call this operator once more, with `again`."""
        raise NotImplementedError

    @reported
    def execute(self: Any, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        footage, folder = open_footage(footage_path(settings)), work_dir(settings, footage_path(settings))
        found = self.read(footage)
        try:
            keep_import(found, footage, folder, self.again)
        except SolveThereError:
            if not self._asks:
                raise
            self.ask()
            return {"CANCELLED"}
        depth_ahead.stop()
        solve, refocus = build_scene(context.scene, footage, folder)
        depth_ahead.begin_after_solve(folder)
        report_hidden(self, context.scene)
        self.report({"INFO"}, f"{found.format}: {solved_words(context.scene, solve.summary)}")
        for note in (*found.notes, *([refocus] if refocus else [])):
            self.report({"WARNING"}, note)
        return {"FINISHED"}

    def confirm(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        settings = context.scene.virtual_aperture
        folder = work_dir(settings, footage_path(settings))
        answer: Result = context.window_manager.invoke_confirm(
            self, event, title="Replace Solve", message=f"{folder} holds a solve of this clip",
            confirm_text="Replace",
        )  # fmt: skip
        return answer


class VIRTUAL_APERTURE_OT_import_solve(Import, bpy.types.Operator):  # noqa: N801
    """Take in the cameras and points that COLMAP, Bundler, VisualSFM or Voodoo found in the clip"""

    bl_idname = "virtual_aperture.import_solve"
    bl_label = "Import Solve"

    filepath: bpy.props.StringProperty(
        name="Model",
        description="File of the model, or the folder of a COLMAP model",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_glob: bpy.props.StringProperty(default="*.bin;*.txt;*.out;*.nvm", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return may_change(cls, context) and has_clip(cls, context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if self.again and self.filepath:
            return self.confirm(context, event)
        self._asks = True
        if not self.filepath:
            # A folder, where models of the clip are likely to be.
            self.filepath = f"{footage_path(context.scene.virtual_aperture).parent}/"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.label(text="Choose the file of a model;")
        column.label(text="of COLMAP's, open the folder.")

    def read(self, footage: Footage) -> Imported:
        return read_model(self.filepath, footage)

    def ask(self) -> None:
        bpy.ops.virtual_aperture.import_solve("INVOKE_DEFAULT", filepath=self.filepath, again=True)


def read_model(filepath: str, footage: Footage) -> Imported:
    """The model in a file or folder; UserError where there is none, or it is not of this clip."""
    if not filepath:
        raise UserError("no model is chosen; give its file, or the folder of a COLMAP model")
    path = Path(bpy.path.abspath(filepath))
    if path.suffix.lower() == ".blend":
        raise UserError(
            f"{path.name} is a .blend: append its movie clip (File > Append) and import that with Import"
            " Movie Clip"
        )
    return read_reconstruction(path, footage)


def solved_clips() -> list[bpy.types.MovieClip]:
    """The movie clips of this file whose camera is solved."""
    return [
        clip
        for clip in bpy.data.movieclips
        if any(item.is_camera and item.reconstruction.is_valid for item in clip.tracking.objects)
    ]


_items: list[tuple[str, str, str]] = []
"""Blender keeps no hold of an enumeration's strings."""


def _clip_items(_operator: Any, _context: bpy.types.Context | None) -> list[tuple[str, str, str]]:
    _items[:] = [(clip.name, clip.name, clip.filepath) for clip in solved_clips()]
    return _items


class VIRTUAL_APERTURE_OT_import_movie_clip(Import, bpy.types.Operator):  # noqa: N801
    """Take in the camera and the tracks of a movie clip that was solved in the Movie Clip Editor"""

    bl_idname = "virtual_aperture.import_movie_clip"
    bl_label = "Import Movie Clip"

    clip: bpy.props.EnumProperty(
        name="Movie Clip", description="Movie clip of this file whose camera is solved", items=_clip_items
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        message = "No movie clip of this file is solved: track one in the Movie Clip Editor first"
        return may_change(cls, context) and has_clip(cls, context) and is_met(cls, solved_clips(), message)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if self.again:
            return self.confirm(context, event)
        self._asks = True
        return self.execute(context)

    def read(self, footage: Footage) -> Imported:
        return read_movie_clip(bpy.data.movieclips[self.clip], footage)

    def ask(self) -> None:
        bpy.ops.virtual_aperture.import_movie_clip("INVOKE_DEFAULT", clip=self.clip, again=True)


CLASSES = (VIRTUAL_APERTURE_OT_import_solve, VIRTUAL_APERTURE_OT_import_movie_clip)
