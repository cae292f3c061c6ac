"""Bringing back what the user deleted, changed or moved of a solved clip."""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.media.clip import Footage, open_footage
from ...core.media.clip_identity import is_clip
from ...core.media.sequence import is_pattern
from ...scene import parts
from ...scene.base.paths import absolute
from ...scene.build import move_clip, restore, restore_camera
from ...scene.edited_camera import edits
from ...scene.sources.clip import footage_path, work_dir
from ...scene.sources.shot import solved_clip
from ..base.operators import Acts, Edits, Result, has_solve, may_change, polls, requires
from .file_import import ShowsClips
from .solve import build_scene, is_kept


class VIRTUAL_APERTURE_OT_restore_objects(Edits, bpy.types.Operator):  # noqa: N801
    """Bring back the camera, the points and other objects of the solve that were deleted"""

    poll = polls(
        may_change, requires(lambda c: parts.missing(c.scene), "No objects of the solve are missing")
    )

    def act(self, context: bpy.types.Context) -> str:
        scene, settings = context.scene, context.scene.virtual_aperture
        words = ", ".join(parts.missing(scene))
        if settings.points is not None:
            restore(scene, _footage(settings))
        elif is_kept(settings):
            # The reconstruction went with the points' mesh.
            clip = footage_path(settings)
            build_scene(scene, open_footage(clip), work_dir(settings, clip))
            self.report({"WARNING"}, "The solve was loaded again; set the focus again")
        else:
            raise UserError("the point cloud was deleted, and the solve with it; solve the clip again")
        return f"Restored: {words}"


class VIRTUAL_APERTURE_OT_restore_camera(Edits, bpy.types.Operator):  # noqa: N801
    """Undo all changes of the clip's camera, which renders ignore"""

    poll = polls(may_change, requires(lambda c: edits(c.scene), "The clip's camera is as it was solved"))

    def act(self, context: bpy.types.Context) -> str:
        edited = edits(context.scene)
        restore_camera(context.scene, _footage(context.scene.virtual_aperture))
        return f"Restored: {', '.join(edited)}"


def _footage(settings: bpy.types.PropertyGroup) -> Footage | None:
    """The solved clip; None if it is missing, which the panel shows."""
    try:
        return solved_clip(settings)
    except UserError:
        return None


class VIRTUAL_APERTURE_OT_find_clip(ShowsClips, Acts, bpy.types.Operator):  # noqa: N801
    """Locate the solved clip after it was moved. Solve, focus and background stay as they are"""

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
