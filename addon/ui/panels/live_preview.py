"""The live preview: a viewport in Rendered shading that looks through the solved camera, and the line in it
between the clip as it was shot and the frame through the lens, to be dragged."""

from itertools import product
from typing import Any

import bpy
import numpy as np

from ...render.engine import VirtualApertureEngine
from ...render.viewport.viewport import PREVIEW, boxes_shown, camera_frame
from ...scene import parts
from ...scene.lens import lens
from ..base.operators import NO_CAMERA, Acts, has_solve, is_met
from ..focus import focus_strip, lens_amount
from ..picking.pick_focus import VIRTUAL_APERTURE_OT_pick_focus
from ..picking.pick_view import WHITE, XY, CameraView, draw_beside, line, ring

NEAR = 8.0
"""Pixels, at a resolution scale of 1, from the line within which the mouse takes it."""
HANDLE = 7.0
"""Radius of the ring on the line, in the same pixels."""
DIM = (1.0, 1.0, 1.0, 0.7)
STOP = 60.0
"""Pixels, at a resolution scale of 1, that the mouse is dragged for a stop."""
CORNER = 0.2
"""Length of a bracket's arm, over the shorter side of its box."""


class VIRTUAL_APERTURE_OT_preview(Acts, bpy.types.Operator):  # noqa: N801
    """Show the frame with depth of field in this viewport, updated as you change settings"""

    # Not UNDO: it changes the viewport, and nothing of the scene but the engine, which solving has set.

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if is_shown(context):
            # Whatever became of the scene: it can be ended.
            return True
        is_there = parts.is_in(context.scene, context.scene.virtual_aperture.camera)
        has_camera = has_solve(cls, context) and is_met(cls, is_there, NO_CAMERA)
        has_view = viewport_of(context) is not None
        return has_camera and is_met(cls, has_view, "There is no 3D viewport in this window")

    def act(self, context: bpy.types.Context) -> None:
        space = viewport_of(context)
        if is_shown(context):
            space.shading.type = "SOLID"
            return
        # Pictures that failed before are tried again.
        PREVIEW.retry()
        context.scene.render.engine = VirtualApertureEngine.bl_idname
        context.scene.camera = context.scene.virtual_aperture.camera
        space.region_3d.view_perspective = "CAMERA"
        space.shading.type = "RENDERED"


def viewport_of(context: bpy.types.Context) -> Any:
    """Return the 3D viewport of a context, or the first one of its window; None without one."""
    if isinstance(context.space_data, bpy.types.SpaceView3D):
        return context.space_data
    areas = context.screen.areas if context.screen is not None else ()
    return next((area.spaces.active for area in areas if area.type == "VIEW_3D"), None)


def is_shown(context: bpy.types.Context) -> bool:
    """Return whether the viewport of a context shows the frame through the lens."""
    space = viewport_of(context)
    return (
        space is not None
        and space.shading.type == "RENDERED"
        and space.region_3d is not None
        and space.region_3d.view_perspective == "CAMERA"
        and context.scene.render.engine == VirtualApertureEngine.bl_idname
    )


class VIRTUAL_APERTURE_GT_wipe(bpy.types.Gizmo):  # noqa: N801
    """A vertical line over the camera's frame; drawn and taken in the region's pixels."""

    bl_idname = "VIRTUAL_APERTURE_GT_wipe"

    def draw(self, context: bpy.types.Context) -> None:
        found = _line(context)
        if found is None:
            return
        x, bottom, top = found
        scale = context.preferences.system.ui_scale
        colour = WHITE if self.is_highlight or self.is_modal else DIM
        middle, radius = (bottom + top) / 2, HANDLE * scale
        if context.scene.virtual_aperture.viewport_wipe > 0 or self.is_modal:
            for ends in (((x, bottom), (x, middle - radius)), ((x, middle + radius), (x, top))):
                line(ends, colour, scale)
        line(ring((x, middle), radius), colour, 1.5 * scale)

    def test_select(self, context: bpy.types.Context, location: XY) -> int:
        """Return 0 if the mouse, in the region's pixels, is on the line or its handle, else -1.

        Only the handle counts while nothing is compared.
        """
        found = _line(context)
        if found is None:
            return -1
        x, bottom, top = found
        near = NEAR * context.preferences.system.ui_scale
        if context.scene.virtual_aperture.viewport_wipe == 0:
            bottom, top = (bottom + top) / 2 - near, (bottom + top) / 2 + near
        return 0 if abs(location[0] - x) <= near and bottom <= location[1] <= top else -1

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        self.before = context.scene.virtual_aperture.viewport_wipe
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, _tweak: Any) -> set[str]:
        frame = camera_frame(context, context.scene)
        if frame is not None and event.type == "MOUSEMOVE":
            # The property keeps it from 0 to 1.
            context.scene.virtual_aperture.viewport_wipe = (event.mouse_region_x - frame[0]) / frame[2]
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        if cancel:
            context.scene.virtual_aperture.viewport_wipe = self.before


class VIRTUAL_APERTURE_GT_amount(bpy.types.Gizmo):  # noqa: N801
    """A ring with the stored amount of blur; dragged up, the lens opens."""

    bl_idname = "VIRTUAL_APERTURE_GT_amount"

    def draw(self, context: bpy.types.Context) -> None:
        place, scale = _ring_place(context), context.preferences.system.ui_scale
        if place is None:
            return
        is_taken = self.is_highlight or self.is_modal
        line(ring(place, HANDLE * scale), WHITE if is_taken else DIM, 3 * scale)
        if is_taken:
            draw_beside(lens_amount.amount_words(context.scene.virtual_aperture), place, place[0], scale)

    def test_select(self, context: bpy.types.Context, location: XY) -> int:
        """Return 0 if the mouse, in the region's pixels, is on the ring, else -1."""
        place, near = _ring_place(context), 2 * NEAR * context.preferences.system.ui_scale
        return 0 if place is not None and np.hypot(*np.subtract(location, place)) <= near else -1

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        settings = context.scene.virtual_aperture
        self.field, self.begun = lens_amount.FIELDS[lens_amount.stored_by(settings)], event.mouse_region_y
        self.before = getattr(settings, self.field)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, _tweak: Any) -> set[str]:
        stops = (event.mouse_region_y - self.begun) / (STOP * context.preferences.system.ui_scale)
        across = 2 ** (stops / 2)
        now = self.before / across if self.field == "f_stop" else self.before * across
        setattr(context.scene.virtual_aperture, self.field, now)
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        if cancel:
            setattr(context.scene.virtual_aperture, self.field, self.before)
        else:
            bpy.ops.ed.undo_push(message="Set Blur")


class VIRTUAL_APERTURE_GT_picture(bpy.types.Gizmo):  # noqa: N801
    """Takes clicks on the picture, which set the focus, and shows the subjects that they would follow."""

    bl_idname = "VIRTUAL_APERTURE_GT_picture"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw brackets round subjects and faces, while the mouse is over the picture."""
        frame = camera_frame(context, context.scene)
        if frame is None or not self.is_highlight:
            return
        left, bottom, width, height = frame
        for first, top, last, low in boxes_shown(context):
            x, y = left + width * np.array([first, last]), bottom + height * (1 - np.array([low, top]))
            arm = CORNER * min(np.ptp(x), np.ptp(y))
            for i, j in product((0, 1), repeat=2):
                arms = (arm - 2 * arm * i, 0), (0, 0), (0, arm - 2 * arm * j)
                line(np.add(arms, (x[i], y[j])), DIM, 1.5 * context.preferences.system.ui_scale)

    def test_select(self, context: bpy.types.Context, location: XY) -> int:
        """Return 0 over the picture, else -1; not over the strip, nor with a tool that does not select."""
        settings, frame = context.scene.virtual_aperture, camera_frame(context, context.scene)
        tool = context.workspace.tools.from_space_view3d_mode(context.mode)
        selects = tool is not None and tool.idname.startswith("builtin.select")
        if frame is None or not (settings.focus_by_click and selects and context.mode == "OBJECT"):
            return -1
        strip = focus_strip.strip_of(context)
        left, bottom, width, height = frame
        is_in = left <= location[0] <= left + width and bottom <= location[1] <= bottom + height
        return 0 if is_in and (strip is None or location[1] > strip.top) else -1


class VIRTUAL_APERTURE_GGT_wipe(bpy.types.GizmoGroup):  # noqa: N801
    """The line, in viewports that show the preview."""

    bl_idname = "VIRTUAL_APERTURE_GGT_wipe"
    bl_label = "Compare"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return is_shown(context) and context.scene.virtual_aperture.points is not None

    def setup(self, _context: bpy.types.Context) -> None:
        self.gizmos.new(VIRTUAL_APERTURE_GT_wipe.bl_idname).use_draw_modal = True
        self.gizmos.new(VIRTUAL_APERTURE_GT_amount.bl_idname).use_draw_modal = True
        # After the others, which are over the same picture.
        picture = self.gizmos.new(VIRTUAL_APERTURE_GT_picture.bl_idname)
        picture.target_set_operator(VIRTUAL_APERTURE_OT_pick_focus.bl_idname).tap = True
        picture.use_tooltip = False


def _line(context: bpy.types.Context) -> tuple[float, float, float] | None:
    """Position x of the line, and its bottom and top, in pixels of the region; None without the camera."""
    frame = camera_frame(context, context.scene)
    if frame is None:
        return None
    left, bottom, width, height = frame
    x = left + context.scene.virtual_aperture.viewport_wipe * width
    return x, max(bottom, 0.0), min(bottom + height, float(context.region.height))


def _ring_place(context: bpy.types.Context) -> XY | None:
    """Place of the ring, in pixels of the region: at the right border; None where nothing is in focus."""
    frame = camera_frame(context, context.scene)
    if frame is None or not lens.is_in_focus(context.scene.virtual_aperture):
        return None
    left, bottom, width, height = frame
    right = min(left + width, CameraView(context.area, context.region).right_border())
    return right - 4 * NEAR * context.preferences.system.ui_scale, bottom + height / 4


def draw_header(header: bpy.types.Header, context: bpy.types.Context) -> None:
    """Draw the switch of clicks in the header of a 3D viewport."""
    if is_shown(context) and context.scene.virtual_aperture.points is not None:
        header.layout.prop(context.scene.virtual_aperture, "focus_by_click", text="", icon="EYEDROPPER")
