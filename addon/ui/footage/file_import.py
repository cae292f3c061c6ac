"""A clip, or what another program solved of it: chosen, by File > Import, or dropped on the 3D viewport.

Blender hands files to a `FileHandler` by their endings, and folders to none: these are for File > Import.
"""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.media.clip_identity import is_clip, is_same_clip
from ...core.media.picture_file import PICTURES
from ...core.media.sequence import pattern_of
from ...core.readers import ENDINGS
from ...core.sfm.state import STATE, read_state
from ...scene.base.paths import absolute, relative
from ...scene.lens.lens import is_in_focus
from ...scene.sources.clip import work_dir
from ..base import operators, solving
from ..base.operators import Edits, Result, may_change, polls, reported
from . import import_solve, solve


class ShowsClips:
    """A file browser that shows videos, pictures and folders."""

    filepath: bpy.props.StringProperty(
        name="Clip",
        description="Video, any image of a sequence, or a folder of images",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    filter_movie: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_image: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})


class VIRTUAL_APERTURE_OT_choose_clip(ShowsClips, Edits, bpy.types.Operator):  # noqa: N801
    """Choose a video, any image of a sequence, or a folder of images"""

    poll = polls(may_change)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        if not self.filepath:
            self.filepath = bpy.path.abspath(context.scene.virtual_aperture.footage)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, _context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.label(text="A video, any image of a sequence,")
        column.label(text="or open a folder of images.")

    def act(self, context: bpy.types.Context) -> None:
        context.scene.virtual_aperture.footage = relative(clip_of(Path(bpy.path.abspath(self.filepath))))


def clip_of(chosen: Path) -> Path:
    """Return the clip of a chosen file or folder: for a picture its sequence as a pattern.

    Raises:
        UserError: Nothing is there, or the picture's name has no number.
    """
    if not chosen.exists():
        raise UserError(f"{chosen} does not exist; choose a video, an image of a sequence or a folder")
    if chosen.is_dir() or chosen.suffix.lower() not in PICTURES:
        return chosen
    pattern = pattern_of(chosen)
    if pattern is None:
        raise UserError(
            f"{chosen.name} is a single image without a frame number; choose a video or an image of a"
            " sequence"
        )
    return pattern


class VIRTUAL_APERTURE_OT_import_clip(ShowsClips, solve.Solves, bpy.types.Operator):  # noqa: N801
    """Choose a video, any image of a sequence, or a folder of images, and solve it.

    If it has been solved before, that solve is loaded
    """

    # Blender shows it where other handlers take the file, too.
    bl_label = "Solve with Virtual Aperture"

    into: bpy.props.EnumProperty(
        name="Open In",
        items=[
            ("HERE", "Replace", "Solve the clip in this scene, whose focus is lost"),
            ("NEW", "Add as New Scene", "Solve the clip in a scene of its own, and leave this one as it is"),
        ],
        options={"SKIP_SAVE"},
    )

    def draw(self, context: bpy.types.Context) -> None:
        if not self._later:
            VIRTUAL_APERTURE_OT_choose_clip.draw(self, context)
            return
        self.layout.label(text=self.question(context)["message"])
        self.layout.row().prop(self, "into", expand=True)

    def _open(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if not (words := self.question(context)):
            return super()._open(context, event)
        self._later = {self.sure_by: True}
        answer: Result = context.window_manager.invoke_props_dialog(
            self, title=words["title"], confirm_text=words["confirm_text"]
        )
        return answer

    def begin(self, context: bpy.types.Context) -> None:
        if self.into == "NEW":
            clip, _ = self.solved_clip(context.scene.virtual_aperture)
            context.window.scene = bpy.data.scenes.new(clip.stem)
        super().begin(context)

    def give_up(self) -> None:
        super().give_up()
        if self.into == "NEW" and (made := bpy.data.scenes.get(self._scene)) is not None:
            bpy.data.scenes.remove(made)

    def question(self, context: bpy.types.Context) -> dict[str, str]:
        settings = context.scene.virtual_aperture
        clip, _ = self.solved_clip(settings)
        if self.sure or not loses_focus(settings, clip):
            return {}
        message = f"In this scene, the focus set for {settings.clip_name} will be lost"
        return {"title": f"Replace {settings.clip_name}?", "message": message, "confirm_text": "Solve"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if bpy.app.background or self.filepath:
            return super().invoke(context, event)
        footage = context.scene.virtual_aperture.footage
        self.filepath, self._later = str(absolute(footage)) if footage else "", {}
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        # Before it is called once more, which would show the browser again.
        self.solved_clip(context.scene.virtual_aperture)
        return super().execute(context)

    def solved_clip(self, settings: bpy.types.PropertyGroup) -> tuple[Path, str]:
        # Not in `poll`, as in dropping models.
        operators.check_may_change(settings.id_data)
        if not self.filepath:
            raise UserError(
                "no clip has been chosen; choose a video, an image of a sequence or a folder of images"
            )
        clip = clip_of(absolute(self.filepath))
        if solving.running_solve() is not None:
            raise UserError(
                f"a clip is being solved; wait, or cancel with ESC, then import {clip.name} again"
            )
        return clip, folder_for(settings, clip)


class VIRTUAL_APERTURE_OT_drop_model(import_solve.ImportsFile, bpy.types.Operator):  # noqa: N801
    """Import the clip's cameras, and points if there are any, from another program or a phone"""

    bl_label = "Import to Virtual Aperture"
    bl_options = {"UNDO", "INTERNAL"}  # noqa: RUF012

    @reported
    def execute(self, context: bpy.types.Context) -> Result:
        name = Path(self.filepath).name
        # Not in `poll`: Blender would then refuse the drop without a message.
        operators.check_may_change(context.scene)
        if not context.scene.virtual_aperture.footage and import_solve.recorded(self.filepath) is None:
            raise UserError(f"{name} is a solve, but no clip has been chosen for it; drop the clip first")
        if solving.running_solve() is not None:
            raise UserError(f"the clip is being solved; cancel with ESC, then drop {name} again")
        return super().execute(context)


def loses_focus(settings: bpy.types.PropertyGroup, clip: Path) -> bool:
    """Return whether a new solve would lose the scene's focus, which is of another clip."""
    return settings.points is not None and is_in_focus(settings) and not is_clip(clip, settings.clip_identity)


def folder_for(settings: bpy.types.PropertyGroup, clip: Path) -> str:
    """Return the working folder that is set; none where that keeps the solve of another clip than this."""
    if not settings.work_dir:
        return ""
    folder = work_dir(settings, clip)
    state = read_state(folder) if (folder / STATE).exists() else None
    return "" if state is not None and not is_same_clip(clip, state["identity"]) else str(settings.work_dir)


class _OnViewport:
    """Takes files that are dropped on a 3D viewport."""

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


class VIRTUAL_APERTURE_FH_clip(_OnViewport, bpy.types.FileHandler):  # noqa: N801
    bl_idname = "VIRTUAL_APERTURE_FH_clip"
    bl_label = "Virtual Aperture Clip"
    bl_import_operator = VIRTUAL_APERTURE_OT_import_clip.bl_idname
    bl_file_extensions = ";".join((*sorted(bpy.path.extensions_movie), *PICTURES))


class VIRTUAL_APERTURE_FH_model(_OnViewport, bpy.types.FileHandler):  # noqa: N801
    bl_idname = "VIRTUAL_APERTURE_FH_model"
    bl_label = "Virtual Aperture Solve"
    bl_import_operator = VIRTUAL_APERTURE_OT_drop_model.bl_idname
    bl_file_extensions = ";".join(ENDINGS)


def draw_menu(menu: bpy.types.Menu, _context: bpy.types.Context) -> None:
    """Draw the entries of File > Import."""
    layout = menu.layout
    layout.operator(VIRTUAL_APERTURE_OT_import_clip.bl_idname, text="Virtual Aperture Clip")
    layout.operator(
        import_solve.VIRTUAL_APERTURE_OT_import_solve.bl_idname,
        text="Virtual Aperture Solve (COLMAP, Bundler, nerfstudio, ...)",
    )
