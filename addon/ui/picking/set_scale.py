"""Telling how large the scene is: the length between two places of the picture."""

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.base.errors import UserError
from ...core.focus.place import Place
from ...core.frame.clip_context import ClipContext
from ...scene.base.timeline import clip_frame
from ...scene.focus.clicks import places
from ...scene.lens import scale
from ...scene.sources.shot import shot_of
from ..base.operators import Result, sentence
from .pick_place import PicksPlaces


def _place(name: str, which: str) -> bpy.props.FloatVectorProperty:
    return bpy.props.FloatVectorProperty(
        name=name, description=f"{which} of the length, from the picture's top left, in shares of its size",
        size=2, min=0, max=1, default=(0.5, 0.5), options={"SKIP_SAVE"},
    )  # fmt: skip


UNCERTAIN = "the depth here is uncertain; click on an edge or a textured surface"


class VIRTUAL_APERTURE_OT_set_scale(PicksPlaces, bpy.types.Operator):  # noqa: N801
    """Click both ends of something whose length you know, in the camera view, then type that length: f-stops
    and distances are true from then on"""

    start: _place("Start", "One end")  # type: ignore[valid-type]
    end: _place("End", "The other end")  # type: ignore[valid-type]
    length: bpy.props.FloatProperty(
        name="Length in Units", description="Between both ends, in scene units; 0: as start and end tell",
        min=0, options={"SKIP_SAVE", "HIDDEN"},
    )  # fmt: skip
    metres: bpy.props.FloatProperty(
        name="Length in Meters",
        description="Distance between the two places, as measured on location",
        default=1.0,
        min=1e-6,
        soft_min=0.01,
        soft_max=100.0,
        precision=3,
        options={"SKIP_SAVE"},
    )

    joins = True
    hint = "Click Both Ends of a Known Length    Ctrl Click: Remove Place    ESC: Cancel"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if not self.length:
            return super().invoke(context, event)
        # Both ends are picked.
        self.metres = self.length * scale.scale(context.scene.virtual_aperture)
        answer: Result = context.window_manager.invoke_props_dialog(self, confirm_text="Set Scale")
        return answer

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "metres")

    def act(self, context: bpy.types.Context) -> str:
        settings = context.scene.virtual_aperture
        length = self.length
        if not length:
            clip = shot_of(context.scene).context
            finder = places(settings, clip, clip_frame(context.scene))
            length = length_between(clip, [finder.find(*xy) for xy in (self.start, self.end)])
        settings.metres_per_unit = self.metres / length
        return f"The scale is set: {self.metres:.4g} m between the two places"

    def took(self, context: bpy.types.Context, place: Place, _shift: bool) -> Result:
        if place.is_estimated:
            self._say(sentence(UNCERTAIN))
            return {"RUNNING_MODAL"}
        self._keep(place)
        return self.confirm(context) if len(self._places) == 2 else {"RUNNING_MODAL"}

    def confirm(self, context: bpy.types.Context) -> Result:
        if len(self._places) < 2:
            return {"RUNNING_MODAL"}
        length = length_between(self._context, self._places)
        self._end(context)
        # Another operator asks for the length: this one has ended, and changed nothing.
        bpy.ops.virtual_aperture.set_scale("INVOKE_DEFAULT", length=length)
        return {"CANCELLED"}


def length_between(clip: ClipContext, ends: Sequence[Place]) -> float:
    """Return the distance between two picked places in scene units.

    Raises:
        UserError: Both are the same place, or one has an estimated depth.
    """
    if any(place.is_estimated for place in ends):
        raise UserError(UNCERTAIN)
    start, end = (clip.places(each.frame).world(each) for each in ends)
    length = float(np.linalg.norm(end - start))
    if not length > 0:
        raise UserError("both ends are in the same place; click two places a known distance apart")
    return length
