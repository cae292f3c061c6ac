"""What is drawn over the camera view while a subject is picked: strokes, and the subject lit up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import bpy
import cv2
import numpy as np

from ..core.base.arrays import Mask
from ..core.subjects.strokes import Stroke
from ..render.gpu_views import upload
from .pick_view import GREEN, RING, WHITE, XY, Overlay, line, ring

TINT = (0.15, 0.75, 1.0)
"""Linear RGB of what is lit up: it stands out from skin, leaves and asphalt."""
INSIDE, OUTLINE = 0.5, 1.0
"""Opacities. By eye."""
RED = (1.0, 0.3, 0.25, 1.0)
STROKE = 2.5
"""Pixels at a resolution scale of 1."""


@dataclass
class SubjectOverlay(Overlay):
    """The subject in the frame that is shown, with its strokes there."""

    shows_points: ClassVar[bool] = False
    strokes: Sequence[Stroke] = ()
    """Those of the frame."""
    line: Sequence[XY] = field(default_factory=list)
    """Fractions of the picture: the stroke that is being drawn."""
    takes: bool = False
    """Whether that one takes away."""
    _texture: Any = None
    mask: Mask | None = None
    """(h, w) over the source frame: the subject."""

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
            self._draw_line(stroke.places, not stroke.adds, scale)
        self._draw_line(self.line, self.takes, scale)
        for place in self.view.pixels(self.scene, [self.mouse] if self.mouse is not None else []):
            line(ring(place, RING * scale), WHITE, 1.5 * scale)

    def _draw_line(self, places: Sequence[XY], takes: bool, scale: float) -> None:
        pixels = self.view.pixels(self.scene, places)
        if len(pixels) == 1:
            pixels = [tuple(each) for each in ring(pixels[0], STROKE * scale)]
        if pixels:
            line(pixels, RED if takes else GREEN, STROKE * scale)

    def _draw_mask(self) -> None:
        import gpu
        from gpu_extras.batch import batch_for_shader

        corners = self.view.pixels(self.scene, [(0, 1), (1, 1), (1, 0), (0, 0)])
        if self.mask is None or not corners:
            return
        if self._texture is None:
            self._texture = upload(tinted(self.mask))
            self._texture.filter_mode(True)
        shader = gpu.shader.from_builtin("IMAGE")
        gpu.state.blend_set("ALPHA_PREMULT")
        shader.bind()
        shader.uniform_sampler("image", self._texture)
        content = {"pos": corners, "texCoord": [(0, 1), (1, 1), (1, 0), (0, 0)]}
        batch_for_shader(shader, "TRI_FAN", content).draw(shader)
        gpu.state.blend_set("NONE")


def tinted(mask: Mask) -> np.ndarray:
    """(h, w, 4) float32, premultiplied: the tint inside a mask (h, w), stronger on its outline."""
    inside = mask.astype(np.uint8)
    rim = inside - cv2.erode(inside, np.ones((3, 3), np.uint8), borderValue=0)
    alpha = np.where(rim > 0, OUTLINE, INSIDE * inside).astype(np.float32)
    return alpha[..., None] * np.array([*TINT, 1.0], np.float32)
