"""The interface of all sources of a frame's depth."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from .sparse import DepthSamples, FrameFeatures, frame_features

SURE = 0.1
"""Confidence in [0, 1] from which on a pixel's depth is known: chosen by inspection."""
FAINTEST = 0.04
"""Opacity up to which a matte's pixel is empty: JPEG's noise around white things. Chosen by inspection."""
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
    """(H, W) opacity in [0, 1] of moving objects by a matte, in front of the background; None without a
    matte. Pixels above `FAINTEST` have the depth of the object."""
    behind: Map | None = None
    """(H, W) inverse depth of the farther surface that other frames know behind each pixel, NaN where they do
    not; None where nothing was looked for."""

    def at_places(self, places: Floats, canvas: Canvas) -> tuple[Floats, Floats, Mask]:
        """Return inverse depth (n,), confidence (n,) in [0, 1], and whether a place moves (n,).

        Args:
            places: (n, 2) in pixels of the canvas; places past the border have the values at it.
            canvas: That of the frame.
        """
        size = np.array([canvas.pinhole.width, canvas.pinhole.height])

        def of[T: np.generic](raster: NDArray[T]) -> NDArray[T]:
            shape = np.array(raster.shape[1::-1])
            column, row = np.clip(np.floor(places * (shape / size)), 0, shape - 1).astype(int).T
            return np.asarray(raster[row, column])

        inverse = of(self.inverse_depth).astype(np.float64)
        sure = np.ones(len(places)) if self.confidence is None else of(self.confidence).astype(np.float64)
        return inverse, sure, np.zeros(len(places), bool) if self.moving is None else of(self.moving)


def extended(values: Floats | Map, past_border: Map | None, margin: int) -> Map:
    """Return values (H, W) with a margin around them, (H + 2 margin, W + 2 margin) float32.

    The margin comes from `past_border` (H + 2 m, W + 2 m), for any m; where it is NaN or ends, from the
    nearest pixel.
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

    A new one is a file here and a line where it is opened (`scene/sources/shot.py`):

    >>> class Wall(DepthSource):
    ...     def at(self, frame, canvas, picture):
    ...         return PixelDepth(np.full((canvas.pinhole.height, canvas.pinhole.width), 1 / 3.0))
    """

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Return the depth of all pixels of a canvas; None if nothing is known of the frame.

        Args:
            frame: Number of the frame.
            canvas: That of the frame.
            picture: (H, W, 4) linear, shown by the canvas; a coarse depth map may follow its edges. With
                `NO_PICTURE` the depth may have its own size.
        """

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """Return `at` with `NO_PICTURE` if it needs no computation; else None."""
        return self.at(frame, canvas, NO_PICTURE)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Return samples of the depth for coarse meshes; None if the source has none."""
        return None


@dataclass(frozen=True)
class FirstKnown(DepthSource):
    """Several sources of depth: each frame's is that of the first one which knows it."""

    sources: tuple[DepthSource, ...]

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Return the depth of all pixels of the canvas (H, W) that the first source knows, else None."""
        found = (source.at(frame, canvas, picture) for source in self.sources)
        return next((depth for depth in found if depth is not None), None)

    def kept(self, frame: int, canvas: Canvas) -> PixelDepth | None:
        """Return `kept` of the first source that has it, else None."""
        found = (source.kept(frame, canvas) for source in self.sources)
        return next((depth for depth in found if depth is not None), None)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Return the samples of the first source that has any, else None."""
        found = (source.samples(frame, canvas) for source in self.sources)
        return next((samples for samples in found if samples is not None), None)


@dataclass(frozen=True)
class SparseDepth(DepthSource):
    """Samples for coarse meshes from feature points; pixels between them are unknown."""

    reconstruction: Reconstruction

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> None:
        """Return None: pixels are unknown."""

    def samples(self, frame: int, canvas: Canvas) -> FrameFeatures:
        """Return the frame's feature points."""
        return frame_features(self.reconstruction, frame, canvas)
