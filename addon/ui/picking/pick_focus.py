"""The eyedropper of the focus: a click on the camera's picture puts what is there in focus."""

from collections.abc import Callable
from dataclasses import replace

import bpy

from ...core.base.errors import UserError
from ...core.focus.picking import unsolved
from ...core.focus.place import Place
from ...scene.base.timeline import clip_frame
from ...scene.focus import focus_marks
from ...scene.focus.clicks import place_at
from ..base.operators import Result
from .pick_place import PicksPlaces
from .pick_vertices import ADD_MARK, focus_on
from .pick_view import XY


def _share(name: str, description: str) -> bpy.props.FloatProperty:
    return bpy.props.FloatProperty(
        name=name, description=description, min=0, max=1, default=0.5, options={"SKIP_SAVE"}
    )


class VIRTUAL_APERTURE_OT_pick_focus(PicksPlaces, bpy.types.Operator):  # noqa: N801
    """Click what should be in focus at the current frame, in the camera view.

    Shift adds places, Ctrl removes them
    """

    add: ADD_MARK
    tap: bpy.props.BoolProperty(
        name="Tap",
        description="The mouse is over the place: take it, and end",
        options={"SKIP_SAVE", "HIDDEN"},
    )
    x: _share("X", "Position from the left, as a fraction of the image width")  # type: ignore[valid-type]
    y: _share("Y", "Position from the top, as a fraction of the image height")  # type: ignore[valid-type]

    hint = "Click: Set    Shift Click: Add Place    Ctrl Click: Remove Place    Enter: Confirm    ESC: Cancel"

    def act(self, context: bpy.types.Context) -> str:
        scene = context.scene
        place = place_at(scene, clip_frame(scene), self.x, self.y)()
        return focus_on(scene.virtual_aperture, clip_frame(scene), [place], self.add)

    def picked(self) -> list[Place]:
        mark = self._mark()
        known = () if mark is None else mark.places
        # Places of the automatic focus are the user's once picked.
        places = [replace(each, is_automatic=False) for each in known if not each.is_bare]
        self._had_places = bool(places)
        return places

    def on_event(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if not self.tap or self._work is not None or event.type == "ESC":
            return super().on_event(context, event)
        # The button is still held as the operator begins.
        if event.type != "LEFTMOUSE" or event.value != "RELEASE":
            return {"PASS_THROUGH"}
        if (frame := clip_frame(self._scene)) not in (solved := self._context.reconstruction).frames:
            raise UserError(unsolved(solved, frame))
        if self._view.place(self._scene, event) is None:
            self._end(context)
            return {"CANCELLED"}
        # With Shift and Ctrl, more places follow.
        self.tap = not (event.shift or event.ctrl)
        return self._click(context, event)

    def search(self, at: XY) -> Callable[[], Place]:
        taken = [place.marks.name for place in self._places if place.marks is not None]
        return place_at(self._scene, clip_frame(self._scene), *at, taken)

    def took(self, context: bpy.types.Context, place: Place, shift: bool) -> Result:
        if shift:
            return self._keep(place)
        self._places = [place]
        return self.confirm(context)

    def confirm(self, context: bpy.types.Context) -> Result:
        self._end(context)
        settings, frame = self._scene.virtual_aperture, clip_frame(self._scene)
        if self._places:
            self.report({"INFO"}, focus_on(settings, frame, self._places, self.add))
            return {"FINISHED"}
        mark = self._mark()
        if mark is None or not self._had_places:
            return {"CANCELLED"}
        number = next(n for n, each in enumerate(settings.marks.items) if each == mark)
        self.report({"INFO"}, f"Removed the focus mark at frame {mark.frame}")
        focus_marks.remove(settings, number)
        return {"FINISHED"}

    def _mark(self) -> bpy.types.PropertyGroup | None:
        """The mark that is picked again, if it is not a new one."""
        settings = self._scene.virtual_aperture
        here = focus_marks.at_frame(settings, clip_frame(self._scene))
        if here is None and not self.add and len(settings.marks.items) == 1:
            return settings.marks.items[0]
        return here
