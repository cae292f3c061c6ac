"""The user's depth maps as a source of depth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, pixel_centres
from ..base.errors import UserError
from ..base.lru_cache import remembered
from ..base.nearest_fill import nearest
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Reconstruction
from .completed_depth import stepped
from .map_fit import ClipFit, FrameLine, fit_clip, fit_depth, frame_line, steadied
from .map_fusion import level_of
from .multi_view_stereo import LONG_SIDE
from .source import DepthSource, PixelDepth
from .sparse import COLUMNS, DepthSamples, frame_features
from .user_maps import DepthMaps
from .view_selection import source_frames

AROUND = 4
"""Frames on either side by which a frame's scale and shift are steadied. Chosen by inspection."""
KEPT_MAPS = 16
"""Frames whose small maps are remembered, 2 MB each: those for the background of one frame, and some more."""
LEAST_AROUND = 3
"""Least number of these frames with a depth at a place. Chosen by inspection."""


@dataclass(frozen=True)
class UserDepth(DepthSource):
    """The user's depth maps of a clip, brought to the unit of its reconstruction."""

    reconstruction: Reconstruction
    maps: DepthMaps
    fit: ClipFit
    """The kind of all maps of the clip, and the line from them to inverse depth."""

    @classmethod
    def of(cls, maps: DepthMaps, reconstruction: Reconstruction) -> UserDepth:
        """Fit the maps to the reconstruction's points; UserError where they explain nothing."""
        return cls(reconstruction, maps, fit_clip(maps, partial(_features, reconstruction)))

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth | None:
        """Return the depth (H, W) of all pixels of the canvas; None without a map.

        Unknown pixels are like the nearest known one. The map does not follow the edges of `picture`. Raises
        UserError if the map cannot be read, or does not fit the frame's points.
        """
        if frame not in self.maps.numbers:
            return None
        places = pixel_centres(canvas.pinhole.width, canvas.pinhole.height)
        inverse = self._at_places(self._without_holes(frame), canvas, places)
        behind = self._behind(frame, canvas) if self.reconstruction.stays and picture.size else None
        return PixelDepth(inverse, origin="your depth maps", behind=behind)

    def _at_places(self, whole: Map, canvas: Canvas, places: Floats) -> Floats:
        """(H, W) inverse depth of a frame's map (h, w), of any size, at places (H, W, 2) in canvas pixels.

        Places past the border have the value at the border.
        """
        x, y = np.moveaxis(canvas.features_to_source(places), -1, 0)
        zoom = np.array(whole.shape) / [canvas.camera.height, canvas.camera.width]
        row, column = (
            np.clip(np.floor(at * each), 0, size - 1).astype(int)
            for at, each, size in zip((y, x), zoom, whole.shape, strict=True)
        )
        return np.asarray(whole[row, column], np.float64)

    def _without_holes(self, frame: int) -> Map:
        """(h, w) a frame's fitted map, what is unknown like the nearest known; errors as of `at`."""
        values = self._fitted(frame)
        whole = np.nan_to_num(nearest(values, ~np.isnan(values))).astype(np.float32)
        # For a camera that stays, no stereo has better edges than the map.
        return stepped(whole, level_of(whole)) if self.reconstruction.stays else whole

    @remembered(KEPT_MAPS)
    def _small(self, frame: int) -> Map:
        """`_without_holes` (h, w) at the size of the background's search."""
        whole = self._without_holes(frame)
        zoom = min(1.0, LONG_SIDE / max(whole.shape))
        size = round(zoom * whole.shape[1]), round(zoom * whole.shape[0])
        return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_NEAREST))

    def _behind(self, frame: int, canvas: Canvas) -> Map:
        """(H, W) inverse depth of the static scene in a canvas.

        It is the median of the maps of frames around it, which have the same viewpoint; NaN where fewer than
        `LEAST_AROUND` have a value.
        """
        here, _ = self.reconstruction.image_at(frame)
        pinhole = canvas.pinhole
        # Behind silhouettes pixels of a large picture are not worth their memory.
        apart = -(-max(pinhole.width, pinhole.height) // LONG_SIDE)
        places = pixel_centres(pinhole.width, pinhole.height)[apart // 2 :: apart, apart // 2 :: apart]
        rays = pinhole.rays(places)
        others = source_frames(self.reconstruction, frame)
        found = [
            self._seen(other, rays @ (other.rotation @ here.rotation.T).T)
            for other in others
            if other.frame in self.maps.numbers
        ]
        ordered = np.sort(np.stack([np.full(places.shape[:2], np.nan, np.float32), *found]), axis=0)
        count = np.count_nonzero(~np.isnan(ordered), axis=0)
        middle = np.take_along_axis(ordered, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
        middle = np.where(count >= LEAST_AROUND, middle, np.float32(np.nan))
        size = pinhole.width, pinhole.height
        return np.asarray(cv2.resize(middle, size, interpolation=cv2.INTER_NEAREST))

    def _seen(self, image: Image, rays: Floats) -> Map:
        """(H, W) inverse depth of a frame's map along rays (H, W, 3) in its camera space.

        It is relative to the axis on which the rays' third parts are 1; NaN past the border, or without a
        usable map.
        """
        canvas = self.reconstruction.canvas(image)
        pinhole, ahead = canvas.pinhole, rays[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            places = rays[..., :2] / ahead[..., None] * pinhole.focal + pinhole.principal_point
        inside = (ahead > 0) & np.all((places >= 0) & (places < [pinhole.width, pinhole.height]), axis=-1)
        try:
            whole = self._small(image.frame)
        except UserError:
            # Said where that frame itself is drawn.
            return np.full(ahead.shape, np.nan, np.float32)
        inverse = self._at_places(whole, canvas, np.where(inside[..., None], places, 0.0))
        return np.where(inside, inverse * ahead, np.nan).astype(np.float32)

    def samples(self, frame: int, canvas: Canvas) -> DepthSamples | None:
        """Return a regular grid of samples, `COLUMNS` across the picture; None without a map."""
        if frame not in self.maps.numbers:
            return None
        clip = self.maps.footage
        xy, inverse_depth = grid_features(self._fitted(frame), clip.width / COLUMNS)
        zoom = np.array([canvas.camera.width / clip.width, canvas.camera.height / clip.height])
        at = canvas.features_from_source(xy * zoom)
        return DepthSamples(frame, at, inverse_depth, frame not in self.reconstruction.frames)

    def _fitted(self, frame: int) -> Floats:
        """Return (H, W) the fitted map of a frame."""
        near = [each for each in self.maps.frames if abs(each - frame) <= AROUND]
        lines = [self._own_line(each) for each in near]
        seen, inverse_depth = _features(self.reconstruction, frame)
        line = steadied(lines, frame, self.fit)
        return fit_depth(self.maps.read(frame), seen, inverse_depth, self.fit, line)

    @remembered()
    def _own_line(self, frame: int) -> FrameLine:
        return frame_line(self.maps.read(frame), *_features(self.reconstruction, frame), self.fit)


def _features(reconstruction: Reconstruction, frame: int) -> tuple[Floats, Floats]:
    canvas = reconstruction.canvas(frame)
    found = frame_features(reconstruction, frame, canvas)
    return canvas.features_to_source(found.observed), found.inverse_depth


def grid_features(fitted: Floats, step: float) -> tuple[Floats, Floats]:
    """Return known places (n, 2) of a regular grid over a fitted map (H, W), and their inverse depths (n,).

    They are about `step` pixels apart, from the centre of the first pixel to that of the last.
    """
    height, width = fitted.shape
    across = np.linspace(0.5, width - 0.5, max(2, round((width - 1) / step) + 1))
    down = np.linspace(0.5, height - 0.5, max(2, round((height - 1) / step) + 1))
    # The centre of the pixel that a place is in, since the map is known there.
    column, row = np.floor(np.meshgrid(across, down)).astype(int).reshape(2, -1)
    inverse = fitted[row, column]
    known = np.isfinite(inverse)
    return np.column_stack([column, row])[known] + 0.5, inverse[known]
