"""Photos in no order: which one is shown and rendered."""

from pathlib import Path

import bpy

from ...core.base.errors import UserError
from ...core.media.sequence import is_pattern
from ...scene.base.timeline import go_to
from ...scene.solve.point_cloud import is_ordered
from ...scene.sources.shot import shot_of
from ..base.operators import Edits, Item, Result, has_solve, listed, polls, requires


def may_be_photos(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the clip is a folder or a pattern, by its name, without access to files."""
    clip = Path(settings.footage)
    return bool(settings.footage) and (not clip.suffix or is_pattern(clip))


def are_photos(settings: bpy.types.PropertyGroup) -> bool:
    """Return whether the scene's solve is one of unordered photos."""
    return settings.points is not None and not is_ordered(settings.points.data)


@listed
def _photos(context: bpy.types.Context) -> list[Item]:
    """The photos that have a camera, by the names of their files."""
    try:
        shot = shot_of(context.scene)
    except UserError:
        return []
    return [(str(frame), shot.footage.file(frame).name, "") for frame in shot.reconstruction.frames.tolist()]


class VIRTUAL_APERTURE_OT_show_photo(Edits, bpy.types.Operator):  # noqa: N801
    """Choose which photo is shown, and rendered by Render Image"""

    bl_property = "photo"

    photo: bpy.props.EnumProperty(name="Photo", description="File name of the photo", items=_photos)

    poll = polls(
        has_solve,
        requires(lambda c: are_photos(c.scene.virtual_aperture), "The clip is not a set of photos"),
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        context.window_manager.invoke_search_popup(self)
        return {"RUNNING_MODAL"}

    def act(self, context: bpy.types.Context) -> None:
        go_to(context.scene, int(self.photo))
