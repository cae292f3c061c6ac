"""Visibility and colour of a frame's positions in other frames."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, Map, Mask
from ..camera.reconstruction import Image, Intrinsics
from ..depth.view_selection import relative_pose
from .lens_table import pixels

CHUNK = 1 << 14
"""Positions processed at once, to fit a processor's cache; OpenCV's `remap` takes at most 32,766 in a row.
Half and twice as many take as long, ten times as many a third longer (fence, 1920x1080)."""


@dataclass(frozen=True)
class Places:
    """Positions in a pinhole's picture, with depth."""

    x: Map
    """(n,) pixels from the left edge."""
    y: Map
    """(n,) pixels from the top edge."""
    inverse: Map
    """(n,) inverse depth, 1 / scene units."""

    @classmethod
    def of(cls, xy: Floats, inverse: Floats) -> Places:
        x, y = np.asarray(xy, np.float32).T
        return cls(x, y, np.asarray(inverse, np.float32))

    def __len__(self) -> int:
        return len(self.x)

    def among(self, which: slice | Mask | Indices) -> Places:
        """Select positions by a mask (n,), a slice or indices (k,)."""
        return Places(self.x[which], self.y[which], self.inverse[which])


@dataclass(frozen=True)
class Reprojection:
    """Projection from a pinhole into another camera.

    It is the homography of the plane at infinity, plus parallax (Irani and Anandan, "A unified approach to
    moving object detection in 2D and 3D scenes", 1998).
    """

    homography: Map
    """(3, 3) to homogeneous pixels of the other camera; to rays if its lens is distorted."""
    parallax: Map
    """(3,) added to those for inverse depth 1."""
    camera: Intrinsics
    """The other camera."""

    @classmethod
    def between(cls, image: Image, pinhole: Intrinsics, other: Image, camera: Intrinsics) -> Reprojection:
        """Make the projection from the pinhole of an image to the lens of another."""
        rotation, translation = relative_pose(image, other)
        there = np.eye(3) if camera.is_distorted else _matrix(camera)
        homography = there @ rotation @ np.linalg.inv(_matrix(pinhole))
        return cls(homography.astype(np.float32), (there @ translation).astype(np.float32), camera)

    def __call__(self, places: Places) -> tuple[Map, Map, Map]:
        """Return x and y (n,) in the other picture, NaN behind its camera, and ratios of depths (n,)."""
        x, y, ratio = (
            row[0] * places.x + row[1] * places.y + (row[2] + parallax * places.inverse)
            for row, parallax in zip(self.homography, self.parallax, strict=True)
        )
        ahead = np.where(ratio > 0, ratio, np.float32(np.nan))
        x, y = x / ahead, y / ahead
        if self.camera.is_distorted:
            x, y = pixels(self.camera, x, y)
        return x, y, ahead


@dataclass(frozen=True)
class SourceView:
    """A source frame's picture and visibility."""

    reprojection: Reprojection
    """From the filled frame into this one."""
    picture: LinearRGB
    """(h, w, 3) linear picture at any size."""
    hides: Map
    """(H, W) least inverse depth of unoccluded positions, infinite for moving objects."""
    gain: Map
    """(3,) ratio of the filled frame's exposure to this one's."""

    def colours(self, places: Places) -> Map:
        """Return (3, n) linear colours at positions of the filled frame, in its exposure, or infinity."""
        x, y, ratio = self.reprojection(places)
        height, width = self.hides.shape
        inside = np.flatnonzero((x >= 0.5) & (x <= width - 0.5) & (y >= 0.5) & (y <= height - 0.5))
        x, y, nearness = x[inside], y[inside], places.inverse[inside] / ratio[inside]
        at = np.minimum(y.astype(np.int32), height - 1) * width + np.minimum(x.astype(np.int32), width - 1)
        sees = np.flatnonzero(nearness >= self.hides.ravel()[at])
        found = np.full((3, len(places)), np.inf, np.float32)
        if len(sees):
            zoom = np.float32(self.picture.shape[1] / width), np.float32(self.picture.shape[0] / height)
            column, row = (v[sees][None] * z - np.float32(0.5) for v, z in zip((x, y), zoom, strict=True))
            colour = cv2.remap(self.picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            found[:, inside[sees]] = colour[0].T * self.gain[:, None]
        return found


def _matrix(camera: Intrinsics) -> Floats:
    """Return a pinhole's calibration matrix K (3, 3)."""
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
