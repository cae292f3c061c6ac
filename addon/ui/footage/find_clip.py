"""Showing where a clip is that does not lie where it lay."""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.media.clip import open_footage
from ...core.media.find_clip import is_clip
from ...core.media.sequence import is_pattern
from ...scene.base.paths import absolute
from ...scene.build import move_clip
from ..base.operators import Acts, Result, has_solve, may_change, polls
from .choose_clip import ShowsClips


class VIRTUAL_APERTURE_OT_find_clip(ShowsClips, Acts, bpy.types.Operator):  # noqa: N801
    """Locate the solved clip after it was moved. Solve, focus and background stay as they are"""

    bl_label = "Find Clip"
    bl_options = {"UNDO"}  # noqa: RUF012

    filepath: bpy.props.StringProperty(
        name="Clip", description="The video, or any image of the sequence", subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )  # fmt: skip

    poll = polls(may_change, has_solve)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        if self.filepath:
            return self.execute(context)
        if bpy.data.filepath:
            self.filepath = f"{Path(bpy.data.filepath).parent}/"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> str:
        settings = context.scene.virtual_aperture
        if not settings.clip_identity:
            raise UserError("this .blend does not record which clip was solved; choose it as Clip")
        if not self.filepath:
            raise UserError(f"no file has been chosen; locate {settings.clip_name}")
        chosen = absolute(self.filepath)
        for path in _meant(chosen, settings.clip_name):
            if is_clip(path, settings.clip_identity):
                move_clip(context.scene, open_footage(path))
                return f"The clip is now {settings.footage}"
        raise UserError(
            f"{chosen.name} is not the clip that was solved, {settings.clip_name}; choose that clip, or"
            f" choose {chosen.name} as Clip and solve it"
        )


def _meant(chosen: Path, name: str) -> list[Path]:
    """Possible clips of a path in the file browser: a sequence by one of its pictures, or its folder."""
    if is_pattern(chosen.parent / name):
        return [chosen.parent / name, chosen / name, chosen, chosen.parent]
    return [chosen, chosen.parent]
