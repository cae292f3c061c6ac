"""A street at night whose lights the camera clips, built by code: a wall of known depth with round lamps.

The camera moves sideways before it, so it needs no solve and no depth. Each lamp, of 2 to 200 times white, is
recorded through a point spread, pixels, noise and 8 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.frame.clip_context import ClipContext
from addon.core.media.light import encode_srgb

FINER = 3
"""Parts of a pixel that lamps are drawn by."""
SPREAD = 0.4
"""Pixels, standard deviation of the point spread before the pixel's own."""
NOISE = 1.5
"""Of 255, standard deviation."""
DEPTH, PACE = 24.0, 0.04
"""Of the wall, and of the camera from one frame to the next, in scene units."""
DARK = 0.02
"""Of white, the wall between the lamps."""
RADIANCE = (2.0, 200.0)
"""Times white, least and largest, evenly spread in its logarithm."""
RADIUS = (0.6, 2.0)
"""Of lamps, in pixels."""
TINTS = np.array([[1, 0.9, 0.7], [1, 1, 1], [0.8, 0.9, 1], [1, 0.7, 0.35], [1, 0.35, 0.25]])


@dataclass(frozen=True)
class NightStreet(DepthSource):
    """The clip, as what reads it asks for it, and its true depth; frames count from 1."""

    size: tuple[int, int]
    count: int
    lamps: int

    @cached_property
    def reconstruction(self) -> Reconstruction:
        """The true cameras, and a point for each lamp."""
        width, height = self.size
        camera = Intrinsics(width, height, 0.9 * width, 0.9 * width, width / 2, height / 2)
        # On a grid, shaken: no two touch.
        across = int(np.ceil(np.sqrt(self.lamps * width / height)))
        cells = np.stack(np.divmod(np.arange(self.lamps), across)[::-1], axis=1)
        shaken = cells + 0.5 + np.random.default_rng(11).uniform(-0.22, 0.22, cells.shape)
        xy = shaken * [width / across, height / -(-self.lamps // across)]
        rays = (xy - camera.principal_point) / camera.focal
        xyz = DEPTH * np.column_stack([rays, np.ones(len(xy))]) + [self.count // 2 * PACE, 0, 0]
        images = []
        for number in range(self.count):
            moved = np.array([-number * PACE, 0.0, 0.0])
            seen = camera.project(xyz + moved)
            images.append(Image(number + 1, np.eye(3), moved, seen, np.arange(len(xyz), dtype=np.int32)))
        points = Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.full(len(xyz), 0.1))
        return Reconstruction((camera,), tuple(images), points)

    @property
    def context(self) -> ClipContext:
        """The clip with its true depth, its frames remembered."""
        return ClipContext(self.reconstruction, lru_cache(maxsize=self.count)(self.read), self)

    def read(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) a frame as `Footage.read` gives it."""
        noise = np.random.default_rng(frame).normal(0, NOISE, (*self.size[::-1], 3))
        shown = 255 * encode_srgb(np.clip(self._light(frame), 0, 1)) + noise
        return np.clip(np.rint(shown), 0, 255).astype(np.uint8)

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """The wall's, of all pixels of the canvas."""
        return PixelDepth(np.full((canvas.pinhole.height, canvas.pinhole.width), 1 / DEPTH))

    def _light(self, frame: int) -> Floats:
        """(H, W, 3) linear light at the sensor before it clips."""
        rng, (width, height) = np.random.default_rng(5), self.size
        radiance = np.exp(rng.uniform(np.log(RADIANCE[0]), np.log(RADIANCE[1]), self.lamps))
        light = radiance[:, None] * TINTS[rng.integers(0, len(TINTS), self.lamps)]
        fine = np.full((FINER * height, FINER * width, 3), DARK, np.float32)
        middles = FINER * self.reconstruction.images[frame - 1].xy
        for (x, y), radius, colour in zip(middles, rng.uniform(*RADIUS, self.lamps), light, strict=True):
            centre = round(16 * (x - 0.5)), round(16 * (y - 0.5))
            cv2.circle(fine, centre, round(16 * FINER * radius), colour.tolist(), -1, shift=4)
        fine = cv2.GaussianBlur(fine, (0, 0), SPREAD * FINER)
        return np.asarray(cv2.resize(fine, self.size, interpolation=cv2.INTER_AREA))
