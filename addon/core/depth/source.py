"""Depth of every pixel of a frame, whoever knows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..camera.canvas import Canvas
from .sparse import DepthSamples


@dataclass(frozen=True)
class PixelDepth:
    """Inverse depth of every pixel of a canvas."""

    inverse_depth: Floats
    """(H, W) 1 / z in the frame's camera, in the reconstruction's unit; finite, not negative."""
    confidence: Map | None = None
    """(H, W) in [0, 1], 0 where the depth is only that of the surroundings; None of depth that is given."""
    moving: Mask | None = None
    """(h, w) what moves by itself, over the canvas at any size; None where that was not looked for."""
    past_border: Map | None = None
    """(H + 2 m, W + 2 m) inverse depth that other frames know around the canvas, NaN where they do not and
    within it; None where nothing was looked for."""


def extended(values: Floats | Map, past_border: Map | None, margin: int) -> Map:
    """(H + 2 margin, W + 2 margin) float32: what is known of each pixel (H, W), and `margin` pixels around.

    There it is what `past_border` (H + 2 m, W + 2 m) tells, whatever m is; where that is NaN, or ends, the
    value of the nearest pixel.
    """
    wide = np.pad(np.asarray(values, np.float32), margin, mode="edge")
    if past_border is not None:
        own = (past_border.shape[0] - values.shape[0]) // 2
        shared = min(own, margin)
        theirs, mine = (
            whole[apart : whole.shape[0] - apart, apart : whole.shape[1] - apart]
            for whole, apart in ((past_border, own - shared), (wide, margin - shared))
        )
        np.copyto(mine, theirs, where=~np.isnan(theirs))
    return wide


class DepthSource(Protocol):
    """Something that may know the depth of a frame: the user's maps, stereo, or the truth of a benchmark."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """The depth of all pixels of the canvas, or None where nothing is known of the frame.

        `picture` (H, W, 4) is what the canvas shows, linear: edges that a coarser depth map may follow.
        """


class SampledDepthSource(DepthSource, Protocol):
    """A depth source that coarse meshes can take samples of."""

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Samples of the depth that take the place of feature points; None where nothing is known."""
