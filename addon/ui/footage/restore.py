"""Bringing back what the user deleted or changed of a solved clip."""

import bpy

from ...core.base.errors import UserError
from ...core.media.clip import Footage, open_footage
from ...scene import parts
from ...scene.build import restore, restore_camera
from ...scene.edited_camera import edits
from ...scene.sources.clip import footage_path, work_dir
from ...scene.sources.shot import solved_clip
from ..base.operators import Edits, may_change, polls, requires
from .solve import build_scene, is_kept


class VIRTUAL_APERTURE_OT_restore_objects(Edits, bpy.types.Operator):  # noqa: N801
    """Bring back the camera, the points and other objects of the solve that were deleted"""

    bl_label = "Restore Objects"

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

    bl_label = "Restore Camera"

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
