"""The user's depth maps as a source of depth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.lru_cache import LRUCache
from ..base.nearest_fill import nearest
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from .completed_depth import stepped
from .map_fit import ClipFit, Fitted, FrameLine, fit_clip, fit_depth, frame_line, steadied
from .source import DepthSource, PixelDepth
from .sparse import DepthSamples, frame_features
from .temporal_fusion import level_of
from .user_maps import DepthMaps

COLUMNS = 100
"""Samples across the picture that coarse meshes take of a depth map: by eye."""

AROUND = 4
"""Frames on either side by which a frame's scale and shift are steadied. By eye."""
KEPT_LINES = 64
"""Frames whose own scale and shift are remembered: a few numbers each."""


@dataclass(frozen=True)
class UserDepth(DepthSource):
    """The user's depth maps of a clip, brought to the unit of its reconstruction."""

    reconstruction: Reconstruction
    maps: DepthMaps
    fit: ClipFit
    """What all maps of the clip have in common: their kind, and the line that takes them to inverse depth."""

    @classmethod
    def of(cls, maps: DepthMaps, reconstruction: Reconstruction) -> UserDepth:
        """Fit the maps to the reconstruction's points; UserError where they explain nothing."""
        return cls(reconstruction, maps, fit_clip(maps, partial(_features, reconstruction)))

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Depth (H, W) of all pixels of the canvas, unknown ones like the nearest known; None without a map.

        UserError where the map cannot be read or does not fit the frame's points. `picture` is not looked at:
        what the user gave is not bent to the picture's edges.
        """
        if frame not in self.maps.numbers:
            return None
        values = self._fitted(frame, canvas).inverse_depth
        pinhole = canvas.pinhole
        grid = np.stack(np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5), axis=-1)
        x, y = np.moveaxis(canvas.features_to_source(grid) / self._zoom(canvas), -1, 0)
        row, column = (
            np.clip(np.floor(at), 0, size - 1).astype(int)
            for at, size in zip((y, x), values.shape, strict=True)
        )
        whole = np.nan_to_num(nearest(values, ~np.isnan(values)))
        if self.reconstruction.stays:
            # There is no stereo that knows its edges better.
            small = whole.astype(np.float32)
            whole = stepped(small, level_of(small)).astype(np.float64)
        return PixelDepth(np.asarray(whole[row, column]), origin="your depth maps")

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """A regular grid of samples, `COLUMNS` across the picture; None without a map."""
        if frame not in self.maps.numbers:
            return None
        step = self.maps.footage.width / COLUMNS
        xy, inverse_depth = grid_features(self._fitted(frame, canvas), step)
        at = canvas.features_from_source(xy * self._zoom(canvas))
        return DepthSamples(frame, at, inverse_depth, frame not in self.reconstruction.frames)

    def _zoom(self, canvas: Canvas) -> Floats:
        """(2,) pixels of the rendered frame a pixel of the clip, across and down."""
        clip = self.maps.footage
        return np.array([canvas.camera.width / clip.width, canvas.camera.height / clip.height])

    def _fitted(self, frame: int, canvas: Canvas) -> Fitted:
        near = [each for each in self.maps.frames if abs(each - frame) <= AROUND]
        lines = [self._lines.get(each, partial(self._own_line, each)) for each in near]
        seen, inverse_depth = _features(self.reconstruction, frame)
        line = steadied(lines, frame, self.fit)
        return fit_depth(self.maps.read(frame), seen, inverse_depth, self.fit, line)

    def _own_line(self, frame: int) -> FrameLine:
        return frame_line(self.maps.read(frame), *_features(self.reconstruction, frame), self.fit)

    @cached_property
    def _lines(self) -> LRUCache[FrameLine]:
        return LRUCache(KEPT_LINES)


def _features(reconstruction: Reconstruction, frame: int) -> tuple[Floats, Floats]:
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image))
    found = frame_features(reconstruction, frame, canvas)
    return canvas.features_to_source(found.observed), found.inverse_depth


def grid_features(fitted: Fitted, step: float) -> tuple[Floats, Floats]:
    """Vertices for a warp mesh: a regular grid about `step` pixels apart, places that are unknown dropped.

    Places (n, 2) in pixels of the clip's picture, from the centre of its first pixel to that of its last, and
    inverse depths (n,).
    """
    height, width = fitted.inverse_depth.shape
    across = np.linspace(0.5, width - 0.5, max(2, round((width - 1) / step) + 1))
    down = np.linspace(0.5, height - 0.5, max(2, round((height - 1) / step) + 1))
    # The centre of the pixel that a place is in, since the map is known there.
    xy = np.floor(np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)) + 0.5
    inverse = fitted.at(xy)
    known = np.isfinite(inverse)
    return xy[known], inverse[known]
