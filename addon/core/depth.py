"""What is known of a frame's depth. For now: the inverse depth of its feature points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .canvas import Canvas
from .reconstruction import Floats, Ints, Reconstruction

MAX_REPROJECTION_ERROR = 3.0
"""Pixels; a feature that misses its own 3D point by more was tracked wrongly in this frame."""


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
    """(n,) point IDs."""
    carried: bool
    """The frame has no pose of its own: pose and features come from its neighbours."""


def frame_features(reconstruction: Reconstruction, frame: int, canvas: Canvas) -> FrameFeatures:
    """Features of a frame whose 3D points lie in front of the camera and project to where they were seen."""
    image, carried = reconstruction.image_at(frame)
    local = image.to_camera(reconstruction.points.xyz[image.points])
    source = reconstruction.intrinsics(image)
    zoom = np.array([canvas.lens.width / source.width, canvas.lens.height / source.height])
    observed = canvas.features_from_source(image.xy * zoom)
    projected = canvas.pinhole.project(local)
    ahead = local[:, 2] > 0
    fits = np.linalg.norm((observed - projected) / zoom, axis=1) < MAX_REPROJECTION_ERROR
    keep = ahead & fits
    return FrameFeatures(
        frame, observed[keep], projected[keep], 1.0 / local[keep, 2], image.points[keep], carried
    )


def point_inverse_depths(reconstruction: Reconstruction, frame: int, points: Ints) -> Floats:
    """(k,) inverse depth of 3D points at a frame, seen there or not; negative behind the camera."""
    image, _ = reconstruction.image_at(frame)
    depth = image.to_camera(reconstruction.points.xyz[points])[:, 2]
    return np.asarray(1.0 / np.where(depth == 0, np.finfo(float).tiny, depth))
