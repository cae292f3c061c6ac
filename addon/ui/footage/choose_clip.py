"""Choosing a clip with the file browser."""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.media.picture_file import PICTURES
from ...core.media.sequence import pattern_of
from ...scene.base.paths import relative
from ..base.operators import Edits, Result, may_change, polls


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

    bl_label = "Choose Clip"

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
