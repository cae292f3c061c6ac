"""What is known of a frame's depth: of its feature points, or at a grid from the user's depth maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.nearest_fill import nearest
from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats, Ints, Reconstruction, seen_by
from .user_maps import ClipFit, DepthMaps, Fitted, fit_clip, fit_depth, grid_features

MAX_REPROJECTION_ERROR = 3.0
"""Pixels; a feature that misses its own 3D point by more was tracked wrongly in this frame."""
COLUMNS = 100
"""Places across the picture that depth is taken from a depth map at."""


@dataclass(frozen=True)
class FrameFeatures:
    """The features of one frame with the inverse depth of their 3D points, in canvas pixels."""

    frame: int
    observed: Floats
    """(n, 2) where the feature was seen."""
    projected: Floats
    """(n, 2) where the actual camera projects its 3D point."""
    inverse_depth: Floats
    """(n,) 1 / z in the actual camera's space, positive."""
    points: Ints
    """(n,) point IDs; -1 where there is no point."""
    carried: bool
    """The frame has no pose of its own: pose and features come from its neighbours."""


def frame_features(reconstruction: Reconstruction, frame: int, canvas: Canvas) -> FrameFeatures:
    """Features of a frame whose 3D points lie in front of the camera and project to where they were seen.

    Points that the frame shows but did not track are seen where they project to.
    """
    image, carried = reconstruction.image_at(frame)
    local, ahead = seen_by(image, reconstruction, image.points)
    source = reconstruction.intrinsics(image)
    zoom = np.array([canvas.lens.width / source.width, canvas.lens.height / source.height])
    observed = canvas.features_from_source(image.xy * zoom)
    projected = canvas.pinhole.project(local)
    with np.errstate(over="ignore", invalid="ignore"):
        fits = np.linalg.norm((observed - projected) / zoom, axis=1) < MAX_REPROJECTION_ERROR
    keep = ahead & fits
    more, in_front = seen_by(image, reconstruction, image.visible)
    added = canvas.pinhole.project(more[in_front])
    return FrameFeatures(
        frame, np.concatenate([observed[keep], added]), np.concatenate([projected[keep], added]),
        1.0 / np.concatenate([local[keep, 2], more[in_front, 2]]),
        np.concatenate([image.points[keep], image.visible[in_front]]), carried,
    )  # fmt: skip


@dataclass(frozen=True)
class MappedDepth:
    """The user's depth maps in the units of a reconstruction."""

    maps: DepthMaps
    fit: ClipFit

    @classmethod
    def of(cls, maps: DepthMaps, reconstruction: Reconstruction) -> MappedDepth:
        """Fit the maps to the reconstruction's points; UserError where they explain nothing."""

        def features(frame: int) -> tuple[Floats, Floats]:
            image, _ = reconstruction.image_at(frame)
            canvas = Canvas(reconstruction.intrinsics(image))
            found = frame_features(reconstruction, frame, canvas)
            return canvas.features_to_source(found.observed), found.inverse_depth

        return cls(maps, fit_clip(maps, features))

    def features(self, found: FrameFeatures, canvas: Canvas) -> FrameFeatures:
        """A grid of places with the map's depth instead of the features; those where the frame has no map."""
        if found.frame not in self.maps.numbers:
            return found
        xy, inverse_depth = grid_features(self._fitted(found, canvas), self.maps.footage.width / COLUMNS)
        at = canvas.features_from_source(xy * self._zoom(canvas))
        return FrameFeatures(
            found.frame, at, at, inverse_depth, np.full(len(at), -1, np.int32), found.carried
        )

    def inverse_depth(self, found: FrameFeatures, canvas: Canvas) -> Floats | None:
        """(h, w) of every pixel of the canvas, unknown ones like the nearest known; None without a map."""
        if found.frame not in self.maps.numbers:
            return None
        values = self._fitted(found, canvas).inverse_depth
        lens = canvas.pinhole
        grid = np.stack(np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5), axis=-1)
        x, y = np.moveaxis(canvas.features_to_source(grid) / self._zoom(canvas), -1, 0)
        row, column = (
            np.clip(np.floor(at), 0, size - 1).astype(int)
            for at, size in zip((y, x), values.shape, strict=True)
        )
        return np.asarray(nearest_known(values)[row, column])

    def _zoom(self, canvas: Canvas) -> Floats:
        clip = self.maps.footage
        return np.array([canvas.lens.width / clip.width, canvas.lens.height / clip.height])

    def _fitted(self, found: FrameFeatures, canvas: Canvas) -> Fitted:
        seen = canvas.features_to_source(found.observed) / self._zoom(canvas)
        return fit_depth(self.maps.read(found.frame), seen, found.inverse_depth, self.fit)


def nearest_known(values: Floats) -> Floats:
    """(h, w) with every NaN replaced by the value of the nearest pixel that has one; 0 where none has."""
    return np.nan_to_num(nearest(values, ~np.isnan(values)))


def point_inverse_depths(reconstruction: Reconstruction, frame: int, points: Ints) -> Floats:
    """(k,) inverse depth of 3D points at a frame, seen there or not; NaN where they do not lie ahead."""
    image, _ = reconstruction.image_at(frame)
    local, ahead = seen_by(image, reconstruction, points)
    return np.asarray(1.0 / np.where(ahead, local[:, 2], np.nan))
