"""What a real camera does to a pinhole's picture: it bends it, and reads it row by row while it turns.

Lengths are pixels, times are in frames. Film is rendered through a wider pinhole, whose places are "ideal"
here, and taken from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import rotation_vector
from sample_scenes.stage import Cameras, Floats


@dataclass(frozen=True)
class RealLens:
    """A camera of `width` x `height` pixels that sees the middle of a wider pinhole's picture."""

    width: int
    height: int
    distortion: float = 0.0
    """Share by which the picture's corner is nearer to its middle than a pinhole's."""
    readout: float = 0.0
    """From the first row to the last."""
    k1: float = 0.0
    """First radial term of COLMAP's and OpenCV's model instead."""

    def ideal(self, xy: Floats, frame: int, cameras: Cameras, focal: float) -> Floats:
        """Where the wide pinhole `cameras` sees at the middle of `frame`, counted from 1, what this camera
        records at `xy` (n, 2); `focal` is that frame's."""
        cx, cy = self.width / 2, self.height / 2
        lens = Intrinsics(self.width, self.height, focal, focal, cx, cy, self.k1)
        place = lens.pinhole_pixels(xy) - [cx, cy]
        corner = np.hypot(self.width, self.height) / 2
        # The inverse of the polynomial of tracking programs: from the recorded place to the ideal one.
        place = place * (1 + self.distortion * (place**2).sum(axis=1, keepdims=True) / corner**2)
        rays = np.column_stack([place / focal, np.ones(len(place))])
        when = self.readout * (xy[:, 1] / self.height - 0.5)
        before, after = max(frame - 2, 0), min(frame, len(cameras) - 1)
        turn = rotation_vector(cameras.rotation[after] @ cameras.rotation[before].T) / (after - before)
        # Within a readout it moves by far less than a pixel's parallax: the turn is all.
        rays = rays - when[:, None] * np.cross(turn, rays) + _second(turn, rays, when)
        return np.asarray(focal * rays[:, :2] / rays[:, 2:] + [cameras.width / 2, cameras.height / 2])

    def recorded(
        self, picture: NDArray[np.float32], frame: int, cameras: Cameras, focal: float
    ) -> NDArray[np.float32]:
        """The camera's picture (H, W, 3), from the wide pinhole's."""
        y, x = np.mgrid[: self.height, : self.width] + 0.5
        places = self.ideal(np.column_stack([x.ravel(), y.ravel()]), frame, cameras, focal) - 0.5
        grid = places.reshape(self.height, self.width, 2).astype(np.float32)
        return np.asarray(
            cv2.remap(picture, grid[..., 0], grid[..., 1], cv2.INTER_CUBIC, None, cv2.BORDER_REPLICATE)
        )


def _second(turn: Floats, rays: Floats, when: Floats) -> Floats:
    """(n, 3) second order of the rotation by -`when` `turn`."""
    return np.asarray(when[:, None] ** 2 / 2 * np.cross(turn, np.cross(turn, rays)))
