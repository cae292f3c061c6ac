"""Visibility and colour of a frame's positions in other frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, Map, Mask
from ..camera.reconstruction import Image, Intrinsics
from ..depth.view_selection import relative_pose

CHUNK = 1 << 14
"""Positions processed at once, to fit a processor's cache; OpenCV's `remap` takes at most 32,766 in a row.
Half and twice as many take as long, ten times as many a third longer (fence, 1920x1080)."""
NODES = 257
"""Nodes of the table in each direction. At 1280x720 the error is below 0.02 pixels for a k1 of -0.3
(tests/warp/test_lens_table.py)."""
BEYOND = 0.05
"""Share of the picture's rays by which the table reaches past them."""
KEPT = 64
"""Remembered tables, 530 kB each: those of the source frames around some frames."""


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

    def chunks(self) -> list[slice]:
        """Return slices of at most `CHUNK` positions."""
        return [slice(first, first + CHUNK) for first in range(0, len(self), CHUNK)]


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


@dataclass(frozen=True)
class LensTable:
    """Offsets of pixels by the lens over a grid of rays."""

    first: Map
    """(2,) ray of the first node."""
    step: Map
    """(2,) from one node to the next."""
    offsets: Map
    """(NODES * NODES, 2) pixels between the lens's picture and a pinhole's, row by row."""
    focal: Map
    """(2,) pixels."""
    middle: Map
    """(2,) principal point in pixels."""

    @classmethod
    def of(cls, camera: Intrinsics) -> LensTable:
        """Tabulate a camera's lens."""
        along = np.linspace(0, 1, NODES)
        size = np.array([camera.width, camera.height])
        border = np.concatenate([
            np.stack(np.broadcast_arrays(*pair), axis=-1)
            for pair in ((along, 0.0), (along, 1.0), (0.0, along), (1.0, along))
        ])  # fmt: skip
        rays = camera.undistort((border * size - camera.principal_point) / camera.focal)
        low, high = np.nanmin(rays, axis=0), np.nanmax(rays, axis=0)
        low, high = low - BEYOND * (high - low), high + BEYOND * (high - low)
        axes = (np.linspace(*ends, NODES) for ends in zip(low, high, strict=True))
        nodes = np.stack(np.meshgrid(*axes), axis=-1)
        offsets = (camera.distort(nodes) - nodes) * camera.focal
        return cls(
            low.astype(np.float32), ((high - low) / (NODES - 1)).astype(np.float32),
            offsets.reshape(-1, 2).astype(np.float32),
            camera.focal.astype(np.float32), camera.principal_point.astype(np.float32),
        )  # fmt: skip

    def __call__(self, x: Map, y: Map) -> tuple[Map, Map]:
        """Return pixels x and y (n,) of rays x and y (n,); NaN past the table."""
        across, down = (x - self.first[0]) / self.step[0], (y - self.first[1]) / self.step[1]
        last = np.float32(NODES - 1)
        inside = (across >= 0) & (across < last) & (down >= 0) & (down < last)
        across, down = (np.where(inside, each, np.float32(0)) for each in (across, down))
        column, row = across.astype(np.int32), down.astype(np.int32)
        u, v = ((each - np.floor(each))[:, None] for each in (across, down))
        at = row * NODES + column
        upper = self.offsets[at] * (1 - u) + self.offsets[at + 1] * u
        lower = self.offsets[at + NODES] * (1 - u) + self.offsets[at + NODES + 1] * u
        offset = upper * (1 - v) + lower * v
        offset[~inside] = np.nan
        return (
            x * self.focal[0] + self.middle[0] + offset[:, 0],
            y * self.focal[1] + self.middle[1] + offset[:, 1],
        )


@lru_cache(maxsize=KEPT)
def lens_table(camera: Intrinsics) -> LensTable:
    """Return the table of a camera's lens, remembered."""
    return LensTable.of(camera)


def pixels(camera: Intrinsics, x: Map, y: Map) -> tuple[Map, Map]:
    """Return pixels x and y (n,) of a distorted camera for rays x and y (n,), float32.

    A rolling shutter is read from a table. NaN where the lens sees nothing.
    """
    if any(camera.readout) and camera.largest_turn:
        return lens_table(camera)(x, y)
    rays: Floats = camera.distort(np.stack([x, y], axis=-1).astype(np.float64))
    x, y = (rays * camera.focal + camera.principal_point).astype(np.float32).T
    return x, y
