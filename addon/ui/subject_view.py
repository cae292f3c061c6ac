"""What is drawn over the camera view while a subject is picked: strokes, and the subject lit up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import bpy

from ..core.subjects.strokes import Stroke
from .pick_view import GREEN, RING, WHITE, XY, Overlay, line, ring

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

    def draw(self) -> None:
        if bpy.context.area != self.view.area or not self.view.is_through_camera():
            return
        scale = bpy.context.preferences.system.ui_scale
        self.draw_mask()
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
