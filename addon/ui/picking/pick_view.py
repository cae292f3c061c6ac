"""The camera view in which a focus is picked: places under the mouse, and the overlay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import blf
import bpy
import cv2
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.base.arrays import Floats, Mask
from ...core.base.errors import UserError
from ...core.subjects.strokes import Stroke
from ...render.viewport import overlay
from ...render.viewport.viewport import frame_in_region
from ...render.views.gpu_views import upload

XY = tuple[float, float]
APART = 0.004
"""Share of the picture between two corners of a stroke."""
SEGMENTS = 24
"""Corners of a circle."""
RING, FEATURE, PICKED = 9.0, 4.0, 6.0
"""Radii in pixels at a resolution scale of 1: round the mouse, of features, of picked places."""
WHITE, GREEN, SHADE = (1.0, 1.0, 1.0, 1.0), (0.25, 1.0, 0.35, 1.0), (0.0, 0.0, 0.0, 0.6)
RED = (1.0, 0.3, 0.25, 1.0)
TINT = (0.15, 0.75, 1.0)
"""Linear RGB of the lit subject: visible on skin, leaves and asphalt."""
INSIDE, OUTLINE = 0.5, 1.0
"""Opacities. Chosen by inspection."""
TEXT = 13
"""Points."""
STROKE = 2.5
"""Pixels at a resolution scale of 1."""


@dataclass(frozen=True)
class CameraView:
    """A 3D viewport of a window, looked at through the camera of a clip."""

    area: bpy.types.Area
    region: bpy.types.Region

    @classmethod
    def of(cls, context: bpy.types.Context) -> CameraView:
        """Return the viewport of a context, or the largest one of its window, looking through the camera.

        Raises:
            UserError: There is none.
        """
        areas = [area for area in context.screen.areas if area.type == "VIEW_3D"]
        if not areas:
            raise UserError("there is no 3D viewport to pick in; open one")
        area = (
            context.area if context.area in areas else max(areas, key=lambda each: each.width * each.height)
        )
        camera, space = context.scene.virtual_aperture.camera, area.spaces.active
        if camera is None or camera.name not in context.scene.objects:
            raise UserError("the clip's camera is no longer in the scene; solve the clip again")
        looked = space.camera if space.use_local_camera else context.scene.camera
        if looked != camera:
            raise UserError(
                f"the view is that of {looked.name if looked else 'no camera'}; select {camera.name} and"
                " press Ctrl Numpad 0 to look through it"
            )
        if space.region_3d.view_perspective != "CAMERA":
            space.region_3d.view_perspective = "CAMERA"
        region = next(region for region in area.regions if region.type == "WINDOW")
        return cls(area, region)

    def is_through_camera(self) -> bool:
        """Return whether the viewport still shows the camera's picture."""
        return bool(self.area.spaces.active.region_3d.view_perspective == "CAMERA")

    def holds(self, event: bpy.types.Event) -> bool:
        """Return whether the mouse is over the view, and not over a sidebar or header in it."""
        at = event.mouse_x, event.mouse_y
        others = (region for region in self.area.regions if region.type != "WINDOW")
        return _within(self.region, at) and not any(_within(region, at) for region in others)

    def place(self, scene: bpy.types.Scene, event: bpy.types.Event) -> XY | None:
        """Fractions of the picture, (0, 0) top left, under the mouse; None past its border."""
        frame = self._frame(scene)
        if frame is None:
            return None
        left, bottom, right, top = frame
        x = (event.mouse_x - self.region.x - left) / (right - left)
        y = (top - (event.mouse_y - self.region.y)) / (top - bottom)
        return (x, y) if 0 <= x <= 1 and 0 <= y <= 1 else None

    def pixels(self, scene: bpy.types.Scene, places: Sequence[Sequence[float]]) -> list[XY]:
        """Return pixels of the region, (0, 0) bottom left, for fractions of the picture."""
        frame = self._frame(scene)
        if frame is None:
            return []
        left, bottom, right, top = frame
        return [(left + x * (right - left), top - y * (top - bottom)) for x, y in places]

    def right_border(self) -> float:
        """Return the pixels of the region up to the sidebar, which may overlap it."""
        sidebars = (region for region in self.area.regions if region.type == "UI" and region.width > 1)
        return float(min([self.region.width, *(region.x - self.region.x for region in sidebars)]))

    def _frame(self, scene: bpy.types.Scene) -> tuple[float, float, float, float] | None:
        """Left, bottom, right, top of the camera's picture in the region, which it may reach past."""
        found = frame_in_region(self.region, self.area.spaces.active.region_3d, scene)
        if found is None:
            return None
        left, bottom, width, height = found
        return left, bottom, left + width, bottom + height


def _within(region: bpy.types.Region, at: tuple[int, int]) -> bool:
    x, y = at[0] - region.x, at[1] - region.y
    return bool(region.width > 1 and 0 <= x < region.width and 0 <= y < region.height)


@dataclass
class Overlay:
    """The drawing over the view while a place or a subject is picked."""

    view: CameraView
    scene: bpy.types.Scene
    mouse: XY | None = None
    """Fractions of the picture."""
    text: str = ""
    """Text beside the mouse."""
    features: Sequence[Sequence[float]] = ()
    """Fractions of the picture of features that the distance comes from."""
    picked: Sequence[XY] = field(default_factory=list)
    """Fractions of the picture of places that are picked."""
    strokes: Sequence[Stroke] = ()
    """Those that the frame has of a subject."""
    line: Sequence[XY] = ()
    """Fractions of the picture: the stroke that is being drawn."""
    takes: bool = False
    """True if the stroke removes pixels."""
    joins: bool = False
    """True if a line connects the last picked place to the mouse."""
    brush: float = 0.0
    """Radius of a brush round the mouse, a share of the picture's width; 0 for none."""
    mask: Mask | None = None
    """(h, w) over the source frame: a subject that is lit up."""
    _texture: Any = None

    def begin(self) -> None:
        """Draw from now on."""
        overlay.show(self.draw)
        self.view.area.tag_redraw()

    def end(self) -> None:
        """Draw no more."""
        overlay.hide(self.draw)
        self.view.area.tag_redraw()

    def extend_line(self, at: XY | None) -> None:
        """Continue the stroke to a place of the mouse; None is beside the picture."""
        if at is None:
            return
        (x, y), self.mouse = self.line[-1], at
        if max(abs(at[0] - x), abs(at[1] - y)) > APART:
            self.line = [*self.line, at]

    def light_up(self, mask: Mask | None) -> None:
        """Show a subject (h, w) over the source frame."""
        self.mask, self._texture = mask, None
        self.view.area.tag_redraw()

    def draw(self) -> None:
        if bpy.context.area != self.view.area or not self.view.is_through_camera():
            return
        scale = bpy.context.preferences.system.ui_scale
        self._draw_mask()
        for stroke in self.strokes:
            self._draw_stroke(stroke.places, not stroke.adds, scale)
        self._draw_stroke(self.line, self.takes, scale)
        for place in self.view.pixels(self.scene, self.features):
            line(ring(place, FEATURE * scale), GREEN, scale)
        for place in self.view.pixels(self.scene, self.picked):
            line(ring(place, PICKED * scale), GREEN, 2 * scale)
        if self.mouse is None:
            return
        (place,) = self.view.pixels(self.scene, [self.mouse]) or [(0.0, 0.0)]
        if self.joins and self.picked:
            line([*self.view.pixels(self.scene, self.picked[-1:]), place], GREEN, scale)
        radius = self._brush_pixels() or RING * scale
        line(ring(place, radius), WHITE, 1.5 * scale)
        draw_beside(self.text, place, self.view.right_border(), scale)

    def _brush_pixels(self) -> float:
        """Radius of the brush in pixels of the region; 0 without one."""
        ends = self.view.pixels(self.scene, [(0, 0), (self.brush, 0)])
        return ends[1][0] - ends[0][0] if ends else 0.0

    def _draw_stroke(self, places: Sequence[XY], takes: bool, scale: float) -> None:
        pixels = self.view.pixels(self.scene, places)
        if len(pixels) == 1:
            pixels = [tuple(each) for each in ring(pixels[0], STROKE * scale)]
        if pixels:
            line(pixels, RED if takes else GREEN, max(STROKE * scale, 2 * self._brush_pixels()))

    def _draw_mask(self) -> None:
        """Draw the subject that is lit up."""
        corners = self.view.pixels(self.scene, [(0, 1), (1, 0)])
        if self.mask is None or not corners:
            return
        if self._texture is None:
            self._texture = upload(tinted(self.mask))
            self._texture.filter_mode(True)
        overlay.draw_texture(self._texture, (*corners[0], *corners[1]), "ALPHA_PREMULT", overlay.TOP_DOWN)


def tinted(mask: Mask) -> np.ndarray:
    """Return (h, w, 4) float32, premultiplied: the tint inside a mask (h, w), stronger on its outline."""
    inside = mask.astype(np.uint8)
    rim = inside - cv2.erode(inside, np.ones((3, 3), np.uint8), borderValue=0)
    alpha = np.where(rim > 0, OUTLINE, INSIDE * inside).astype(np.float32)
    return alpha[..., None] * np.array([*TINT, 1.0], np.float32)


def ring(middle: XY, radius: float) -> Floats:
    """Return (n, 2) a closed circle in pixels."""
    turn = np.linspace(0, 2 * np.pi, SEGMENTS + 1)
    return np.column_stack([np.cos(turn), np.sin(turn)]) * radius + middle


def line(places: Sequence[Sequence[float]] | Floats, colour: tuple[float, ...], width: float) -> None:
    """Draw a line through pixels (n, 2) of the region, with a dark rim that shows on any picture."""
    corners = np.pad(np.asarray(places, np.float32), ((0, 0), (0, 1)))
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINE_STRIP", {"pos": corners})
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    for wide, drawn in ((width + 2, SHADE), (width, colour)):
        shader.uniform_float("lineWidth", wide)
        shader.uniform_float("color", drawn)
        batch.draw(shader)
    gpu.state.blend_set("NONE")


def draw_beside(text: str, mouse: XY, border: float, scale: float) -> None:
    """Draw a line beside a place of the region, on its left where it would reach past a border."""
    blf.size(0, TEXT * scale)
    width, gap = blf.dimensions(0, text)[0], 16 * scale
    left = mouse[0] + gap if mouse[0] + gap + width < border else mouse[0] - gap - width
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 1.0)
    blf.shadow_offset(0, 1, -1)
    blf.color(0, *WHITE)
    blf.position(0, left, mouse[1] + 12 * scale, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)
