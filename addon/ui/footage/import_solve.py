"""Operators that import solves of other programs, or of Blender's own tracker."""

from pathlib import Path
from typing import Any

import bpy

from ...core.base.errors import UserError
from ...core.media.clip import Footage, open_footage
from ...core.readers import ENDINGS, read_reconstruction, recorded_clip, recorded_depth
from ...core.readers.matching import Imported
from ...core.sfm.workspace import SolveThereError, is_solved, keep_import
from ...scene.sources.clip import footage_path, work_dir
from ...scene.sources.movieclip import read_movie_clip
from ...scene.sources.scene_camera import cameras_of, read_scene_camera
from ..base import operators
from ..base.operators import Result, has_clip, is_idle, may_change, polls, reported, requires
from ..jobs import depth_ahead
from .solve import Solves, build_scene, focus_on_person, report_hidden, solved_words


class Import(operators.Named):
    """Read a model, keep it in the working folder, and bring it into the scene.

    An existing solve is only replaced after a question.
    """

    bl_options = {"UNDO"}  # noqa: RUF012

    again: bpy.props.BoolProperty(
        name="Replace",
        description="Replace the clip's solve in the working folder",
        options={"SKIP_SAVE", "HIDDEN"},
    )

    _asks = False

    def read(self, footage: Footage) -> Imported:
        """Return the import; UserError if it fails."""
        raise NotImplementedError

    def clip_of(self, settings: Any) -> Path:
        """Return the clip that it is of; UserError where there is none."""
        if not settings.footage:
            raise UserError("no clip has been chosen; choose the clip first, then import its solve")
        return footage_path(settings)

    @reported
    def execute(self: Any, context: bpy.types.Context) -> Result:
        settings = context.scene.virtual_aperture
        clip = self.clip_of(settings)
        footage = open_footage(clip, pixel_aspect=settings.pixel_aspect)
        folder = work_dir(settings, clip)
        found = self.read(footage)
        try:
            if found.lacks_points:
                is_solved(folder, footage, {"imported": found.format}, self.again)
                return find_points(found, clip)
            keep_import(found, footage, folder, self.again)
        except SolveThereError:
            if not self._asks:
                raise
            self.once_more(again=True)
            return {"CANCELLED"}
        depth_ahead.stop()
        _, refocus = build_scene(context.scene, footage, folder)
        depth_ahead.begin_after_solve(folder)
        focus_on_person(self, context.scene)
        report_hidden(self, context.scene)
        self.report({"INFO"}, f"Imported {found.format}. {solved_words(context.scene)}")
        for note in (*found.notes, *([refocus] if refocus else [])):
            self.report({"WARNING"}, note)
        return {"FINISHED"}

    def invoke(self: Any, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if not self.again:
            self._asks = True
            result: Result = self.begin(context)
            return result
        settings = context.scene.virtual_aperture
        message = f"{work_dir(settings, footage_path(settings))} already holds a solve of this clip"
        return operators.asked(
            self, context, event, title="Replace Solve", message=message, confirm_text="Replace"
        )

    def begin(self, context: bpy.types.Context) -> Result:
        """Import, or first let the user choose a file or camera."""
        return self.execute(context)


def find_points(found: Imported, clip: Path) -> Result:
    """Find the points of a clip with known cameras, with ESC to cancel; UserError if it fails."""
    VIRTUAL_APERTURE_OT_find_points.wanted = found, clip
    try:
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        result: Result = bpy.ops.virtual_aperture.find_points(how)
    except RuntimeError as error:
        raise operators.refused(error) from None
    # In a window the operator goes on after this one has ended.
    return {"FINISHED"} if "FINISHED" in result else {"CANCELLED"}


class VIRTUAL_APERTURE_OT_find_points(Solves, bpy.types.Operator):  # noqa: N801
    """Track the clip's features and place them in 3D from its known cameras"""

    bl_options = {"UNDO", "INTERNAL"}  # noqa: RUF012

    wanted: tuple[Imported, Path] | None = None
    """Class attribute: the cameras and their clip."""
    # The caller has asked the question.
    again = True

    def solved_clip(self, settings: Any) -> tuple[Path, str]:
        wanted, VIRTUAL_APERTURE_OT_find_points.wanted = self.wanted, None
        if wanted is None:
            raise UserError("there are no cameras to find points for; import some")
        self._cameras, clip = wanted
        return clip, settings.work_dir


class ImportsFile(Import):
    """Import a model from a file or folder, and the depth that a phone has recorded beside it."""

    filepath: bpy.props.StringProperty(
        name="Model",
        description="Model file, or the folder of a COLMAP model",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )

    def clip_of(self, settings: Any) -> Path:
        return recorded(self.filepath) or super().clip_of(settings)

    def read(self: Any, footage: Footage) -> Imported:
        if not self.filepath:
            raise UserError("no model has been chosen; choose its file, or the folder of a COLMAP model")
        path = _model_path(self.filepath)
        if path.suffix.lower() == ".blend":
            raise UserError(
                f"{path.name} is a .blend; append its movie clip (File > Append) and use Import Movie Clip"
            )
        found = read_reconstruction(path, footage)
        depth = recorded_depth(path, work_dir(bpy.context.scene.virtual_aperture, footage.path))
        if depth is not None:
            self.report({"INFO"}, f"The phone's LiDAR depth is in {depth}; choose it as Depth Maps")
        return found


class VIRTUAL_APERTURE_OT_import_solve(ImportsFile, bpy.types.Operator):  # noqa: N801
    """Import the clip's cameras, and points if there are any, from another program or a phone"""

    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{ending}" for ending in (*ENDINGS, ".csv")), options={"HIDDEN"}
    )

    poll = polls(may_change, is_idle)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if self.again and not self.filepath:
            return self.begin(context)
        return super().invoke(context, event)

    def begin(self, context: bpy.types.Context) -> Result:
        if not self.filepath:
            # A folder, where models of the clip are likely to be.
            settings = context.scene.virtual_aperture
            self.filepath = f"{footage_path(settings).parent}/" if settings.footage else ""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.label(text="Choose a model file,")
        column.label(text="or open a COLMAP model's folder.")


def recorded(filepath: str) -> Path | None:
    """Return the clip that a phone's recording brings with it; None of another file."""
    return recorded_clip(_model_path(filepath)) if filepath else None


def _model_path(filepath: str) -> Path:
    """A table stands for the folder of the recording that it is of."""
    path = Path(bpy.path.abspath(filepath))
    return path.parent if path.suffix.lower() == ".csv" else path


def solved_clips() -> list[bpy.types.MovieClip]:
    """Return the movie clips of this file whose camera is solved."""
    return [
        clip
        for clip in bpy.data.movieclips
        if any(item.is_camera and item.reconstruction.is_valid for item in clip.tracking.objects)
    ]


@operators.listed
def _clip_items(_context: bpy.types.Context) -> list[operators.Item]:
    return [(clip.name, clip.name, clip.filepath) for clip in solved_clips()]


class VIRTUAL_APERTURE_OT_import_movie_clip(Import, bpy.types.Operator):  # noqa: N801
    """Import the camera and tracks of a movie clip solved in the Movie Clip Editor"""

    clip: bpy.props.EnumProperty(
        name="Movie Clip", description="Movie clip in this file with a solved camera", items=_clip_items
    )

    poll = polls(
        may_change, has_clip,
        requires(
            lambda _: solved_clips(),
            "No movie clip in this file is solved; track and solve one in the Movie Clip Editor first",
        ),
    )  # fmt: skip

    def read(self, footage: Footage) -> Imported:
        return read_movie_clip(bpy.data.movieclips[self.clip], footage)


class VIRTUAL_APERTURE_OT_use_scene_camera(Import, bpy.types.Operator):  # noqa: N801
    """Use an animated camera of this scene as the clip's camera.

    Its motion and lens are kept, and points are found for it
    """

    camera: bpy.props.StringProperty(
        name="Camera", description="Camera of this scene with the motion the clip was filmed with",
        options={"SKIP_SAVE"},
    )  # fmt: skip
    offset: bpy.props.IntProperty(
        name="Frame Offset", description="How many frames later the scene's camera motion is than the clip",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    poll = polls(
        may_change, is_idle, has_clip,
        requires(lambda c: cameras_of(c.scene), "The scene has no other camera; import or animate one first"),
    )  # fmt: skip

    def begin(self, context: bpy.types.Context) -> Result:
        self.camera = self.camera or cameras_of(context.scene)[0].name
        shown: Result = context.window_manager.invoke_props_dialog(self)
        return shown

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop_search(self, "camera", context.scene, "objects", icon="CAMERA_DATA")
        layout.prop(self, "offset")

    def read(self, footage: Footage) -> Imported:
        scene = bpy.context.scene
        found = {thing.name: thing for thing in cameras_of(scene)}
        if self.camera not in found:
            raise UserError(f"the scene has no camera {self.camera!r}; choose one of {', '.join(found)}")
        return read_scene_camera(scene, found[self.camera], footage, self.offset)
