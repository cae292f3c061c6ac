"""CG objects in a frame: layers beside those of the clip, drawn by the same views."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA
from ..camera.canvas import Canvas
from ..camera.reconstruction import Intrinsics
from ..depth.source import PixelDepth
from ..warp.cg_layer import CGLayer


@dataclass(frozen=True)
class CGObjects:
    """CG objects as the frame's camera sees them."""

    layers: tuple[CGLayer, ...] = ()
    shadow: LinearRGB | None = None
    """(h, w, 3) share of the clip's light in their shadow, over the canvas; None without shadows."""

    def scaled(self, before: Intrinsics, after: Intrinsics) -> CGObjects:
        """Scale to another canvas with the same pinhole at another size."""
        if before == after:
            return self
        shadow = self.shadow
        if shadow is not None:
            size = after.width, after.height
            shadow = np.asarray(cv2.resize(shadow, size, interpolation=cv2.INTER_AREA), np.float32)
        return CGObjects(tuple(each.scaled(before, after) for each in self.layers), shadow)

    def shaded(self, picture: LinearRGBA) -> LinearRGBA:
        """Return the canvas's picture (h, w, 4) with their shadows."""
        if self.shadow is None:
            return picture
        return np.concatenate([picture[..., :3] * self.shadow, picture[..., 3:]], axis=2)


NO_CG = CGObjects()
DrawCG = Callable[[int, Canvas, PixelDepth | None], CGObjects]
"""Draws the CG objects of a frame for a canvas, with its depth if known."""
