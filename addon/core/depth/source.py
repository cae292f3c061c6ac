"""Depth of every pixel of a frame, whoever knows it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..camera.canvas import Canvas
from .sparse import DepthSamples

SURE = 0.1
"""Confidence in [0, 1] from which on a pixel's depth is known: chosen by inspection."""
FAINTEST = 0.04
"""Opacity up to which a matte says nothing: about what JPEG leaves around white things. Chosen by
inspection."""
NO_PICTURE: LinearRGBA = np.zeros((0, 0, 4), np.float32)
"""Instead of a picture, where only the geometry is asked for."""


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
    origin: str = "depth that is given"
    """Where it comes from, for people."""
    opacity: Map | None = None
    """(H, W) in [0, 1] of what a matte says moves by itself, as which all above `FAINTEST` has the depth of
    that: how much of a pixel it covers, before what lies behind; None without a matte."""
    behind: Map | None = None
    """(H, W) inverse depth of the farther surface that other frames know behind each pixel, NaN where they do
    not; None where nothing was looked for."""

    def at_places(self, places: Floats, canvas: Canvas) -> tuple[Floats, Floats, Mask]:
        """Inverse depth (n,), confidence (n,) in [0, 1] and whether it moves by itself (n,), of the pixels
        that hold places (n, 2) in pixels of the canvas; of places past the border those at it."""
        size = np.array([canvas.pinhole.width, canvas.pinhole.height])

        def of[T: np.generic](raster: NDArray[T]) -> NDArray[T]:
            shape = np.array(raster.shape[1::-1])
            column, row = np.clip(np.floor(places * (shape / size)), 0, shape - 1).astype(int).T
            return np.asarray(raster[row, column])

        inverse = of(self.inverse_depth).astype(np.float64)
        sure = np.ones(len(places)) if self.confidence is None else of(self.confidence).astype(np.float64)
        return inverse, sure, np.zeros(len(places), bool) if self.moving is None else of(self.moving)


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
    """Something that may know the depth of a frame: the user's maps, stereo, or the truth of a benchmark.

    A new one is a file here and a line where it is opened (`scene/shot.py`):

    >>> class Wall(DepthSource):
    ...     def at(self, frame, canvas, picture):
    ...         return PixelDepth(np.full((canvas.pinhole.height, canvas.pinhole.width), 1 / 3.0))
    """

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """The depth of all pixels of the canvas, or None where nothing is known of the frame.

        `picture` (H, W, 4) is what the canvas shows, linear: edges that a coarser depth map may follow. With
        `NO_PICTURE` the depth may have the size at which it is known instead of the canvas's.
        """

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """What `at` tells with `NO_PICTURE`, as far as nothing has to be computed for it first; else None."""
        return self.at(frame, canvas, NO_PICTURE)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Samples of the depth for coarse meshes; None where the source has none of its own."""
        return None


@dataclass(frozen=True)
class FirstKnown(DepthSource):
    """Several sources of depth: each frame's is that of the first one which knows it."""

    sources: tuple[DepthSource, ...]

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """The depth of all pixels of the canvas (H, W) that the first source knows, else None."""
        found = (source.at(frame, canvas, picture) for source in self.sources)
        return next((depth for depth in found if depth is not None), None)

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """What the first source knows that need not compute anything for it, else None."""
        found = (source.kept(frame, canvas) for source in self.sources)
        return next((depth for depth in found if depth is not None), None)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """The samples of the first source that has any, else None."""
        found = (source.samples(frame, canvas) for source in self.sources)
        return next((samples for samples in found if samples is not None), None)
