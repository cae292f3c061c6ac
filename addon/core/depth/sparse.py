"""Depth of a frame's feature points."""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, Ints
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction, seen_by

MAX_REPROJECTION_ERROR = 3.0
"""Pixels by which a feature that was tracked wrongly misses its 3D point. Chosen by inspection."""
FEWEST_POINTS = 8
"""Least feature points of a frame for a range of depths, or the fit of a map. Chosen by inspection."""
COLUMNS = 100
"""Samples of dense depth across the picture, for coarse meshes. Chosen by inspection."""


@dataclass(frozen=True)
class DepthSamples:
    """Places of a canvas whose depth is known."""

    frame: int
    observed: Floats
    """(n, 2) canvas pixels at which the places are seen."""
    inverse_depth: Floats
    """(n,) 1 / z in the frame's camera, in the reconstruction's unit, positive."""
    pose_interpolated: bool
    """True if the frame has no pose: pose and samples come from its neighbours."""


@dataclass(frozen=True)
class FrameFeatures(DepthSamples):
    """The feature points of a frame as depth samples: those with a 3D point that fits what was seen."""

    projected: Floats
    """(n, 2) canvas pixels at which the frame's camera projects the 3D points."""
    points: Ints
    """(n,) IDs of the 3D points, rows of `Reconstruction.points`."""


def frame_features(reconstruction: Reconstruction, frame: int, canvas: Canvas) -> FrameFeatures:
    """Features of a frame whose 3D points lie in front of the camera and project to where they were seen."""
    image, pose_interpolated = reconstruction.image_at(frame)
    local, ahead = seen_by(image, reconstruction, image.points)
    source = reconstruction.intrinsics(image)
    zoom = np.array([canvas.camera.width / source.width, canvas.camera.height / source.height])
    observed = canvas.features_from_source(image.xy * zoom)
    projected = canvas.pinhole.project(local)
    with np.errstate(over="ignore", invalid="ignore"):
        fits = np.linalg.norm((observed - projected) / zoom, axis=1) < MAX_REPROJECTION_ERROR
    keep = ahead & fits
    return FrameFeatures(
        frame, observed[keep], 1.0 / local[keep, 2], pose_interpolated, projected[keep], image.points[keep]
    )


def point_inverse_depths(reconstruction: Reconstruction, frame: int, points: Ints) -> Floats:
    """Return the inverse depth (k,) of 3D points at a frame, seen there or not; NaN behind the camera."""
    image, _ = reconstruction.image_at(frame)
    local, ahead = seen_by(image, reconstruction, points)
    return np.asarray(1.0 / np.where(ahead, local[:, 2], np.nan))
