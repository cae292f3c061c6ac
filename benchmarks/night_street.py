"""A street at night whose lights the camera clips, built by code: windows, lamps, headlights, reflections.

Planes of known depth before a camera that moves sideways, so it needs no solve and no depth. Each light, of
2 to 200 times white, is an ellipse or a rectangle on one of the planes, recorded through a point spread,
pixels, noise and 8 bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.frame.clip_context import ClipContext
from addon.core.media.light import encode_srgb

FINER = 3
"""Parts of a pixel that lights are drawn by."""
SPREAD = 0.4
"""Pixels, standard deviation of the point spread before the pixel's own."""
NOISE = 1.5
"""Of 255, standard deviation."""
FAR, HOUSES, CARS = 60.0, 24.0, 12.0
"""Depth of the planes: what is at the end of the street, houses left and right, cars and the wet road."""
PACE = 0.04
"""Scene units from one frame to the next."""
LIGHTS = 1200
"""Of which a frame shows about 1,160 blobs at 1280x720."""
RADIANCE = (2.0, 200.0)
"""Times white, least and largest, evenly spread in its logarithm."""
TINTS = np.array([[1, 0.9, 0.7], [1, 1, 1], [0.8, 0.9, 1], [1, 0.7, 0.35], [1, 0.35, 0.25]])


@dataclass(frozen=True)
class NightStreet:
    """The clip, as what reads it asks for it; frames count from 1."""

    size: tuple[int, int] = (1280, 720)
    count: int = 24
    lights: int = LIGHTS

    @cached_property
    def camera(self) -> Intrinsics:
        width, height = self.size
        return Intrinsics(width, height, 0.9 * width, 0.9 * width, width / 2, height / 2)

    @cached_property
    def reconstruction(self) -> Reconstruction:
        """The true cameras, and a point for each light."""
        xyz, _, _, _ = self._placed
        images = []
        for number in range(self.count):
            moved = np.array([-number * PACE, 0.0, 0.0])
            seen = self.camera.project(xyz + moved)
            images.append(Image(number + 1, np.eye(3), moved, seen, np.arange(len(xyz), dtype=np.int32)))
        points = Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.full(len(xyz), 0.1))
        return Reconstruction((self.camera,), tuple(images), points)

    @property
    def context(self) -> ClipContext:
        """The clip with its true depth, its frames remembered."""
        return ClipContext(self.reconstruction, lru_cache(maxsize=self.count)(self.read), StreetDepth(self))

    def read(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) a frame as `Footage.read` gives it."""
        noise = np.random.default_rng(frame).normal(0, NOISE, (*self.size[::-1], 3))
        shown = 255 * encode_srgb(np.clip(self.light(frame), 0, 1)) + noise
        return np.clip(np.rint(shown), 0, 255).astype(np.uint8)

    def inverse_depth(self, frame: int) -> Floats:
        """(H, W) of the planes."""
        return np.choose(self._planes(frame), 1 / np.array([FAR, HOUSES, CARS]))

    def light(self, frame: int) -> Map:
        """(H, W, 3) linear light at the sensor before it clips."""
        planes = self._planes(frame)
        rng = np.random.default_rng(5)
        coarse = cv2.resize(rng.random((45, 80, 3), np.float32), self.size, interpolation=cv2.INTER_CUBIC)
        ground = np.array([0.01, 0.03, 0.02], np.float32)[planes][..., None] * (0.5 + coarse)
        xyz, extent, light, is_round = self._placed
        middle = FINER * self.camera.project(xyz - [(frame - 1) * PACE, 0, 0])
        extent = FINER * extent * self.size[0] / 1280
        fine = np.zeros((FINER * self.size[1], FINER * self.size[0], 3), np.float32)
        for (x, y), (across, down), colour, rounded in zip(middle, extent, light, is_round, strict=True):
            centre = round(16 * (x - 0.5)), round(16 * (y - 0.5))
            axes = round(16 * across), round(16 * down)
            if rounded:
                cv2.ellipse(fine, centre, axes, 0, 0, 360, colour.tolist(), -1, shift=4)
            else:
                corners = [tuple(c + s * a for c, a in zip(centre, axes, strict=True)) for s in (-1, 1)]
                cv2.rectangle(fine, *corners, colour.tolist(), -1, shift=4)  # type: ignore[call-overload]
        fine = cv2.GaussianBlur(fine, (0, 0), SPREAD * FINER)
        return np.asarray(ground + cv2.resize(fine, self.size, interpolation=cv2.INTER_AREA), np.float32)

    def _planes(self, frame: int) -> NDArray[np.intp]:
        """(H, W) which plane each pixel shows: 0 far, 1 houses, 2 cars and road."""
        width, height = self.size
        x = np.arange(width)[None] + 0.5 - self.camera.cx
        beside = np.abs(x / self.camera.fx * HOUSES + (frame - 1) * PACE) > 0.16 * HOUSES
        road = np.arange(height)[:, None] > 0.72 * height
        return np.where(road, 2, np.where(beside, 1, 0)) + np.zeros((height, width), np.intp)

    @cached_property
    def _placed(self) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
        """(n, 3) places of lights, their half width and height (n, 2) in pixels at 1280, linear light (n, 3),
        and whether they are round."""
        rng = np.random.default_rng(11)
        width, height = self.size
        # On a grid, shaken: no two touch.
        across = int(np.ceil(np.sqrt(self.lights * width / height)))
        down = -(-self.lights // across)
        cells = np.stack(np.meshgrid(np.arange(across), np.arange(down)), axis=-1).reshape(-1, 2)
        cells = rng.permutation(cells)[: self.lights]
        share = (cells + 0.5 + rng.uniform(-0.22, 0.22, cells.shape)) / [across, down]
        xy = share * [0.96 * width, 0.96 * height] + [0.02 * width, 0.02 * height]
        plane = self._planes(self.count // 2)[xy[:, 1].astype(int), xy[:, 0].astype(int)]
        depth = np.array([FAR, HOUSES, CARS])[plane]
        rays = (xy - self.camera.principal_point) / self.camera.focal
        xyz = np.column_stack([rays, np.ones(len(xy))]) * depth[:, None]
        xyz[:, 0] += self.count // 2 * PACE
        is_round = rng.random(len(xy)) < np.array([0.8, 0.35, 0.7])[plane]
        extent = rng.uniform([1.0, 1.0], [4.5, 5.5], (len(xy), 2))
        extent[is_round] = rng.uniform(0.6, 3.5, (int(is_round.sum()), 1))
        # Reflections on the road are long and thin.
        wet = (plane == 2) & (rng.random(len(xy)) < 0.4)
        count = int(wet.sum())
        extent[wet] = np.column_stack([rng.uniform(1, 2, count), rng.uniform(3, 7, count)])
        radiance = np.exp(rng.uniform(np.log(RADIANCE[0]), np.log(RADIANCE[1]), len(xy)))
        light = radiance[:, None] * TINTS[rng.integers(0, len(TINTS), len(xy))]
        return xyz, extent, light, is_round


@dataclass(frozen=True)
class StreetDepth(DepthSource):
    """The true depth of a night street."""

    street: NightStreet

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        """Of all pixels of the canvas, at the street's own size."""
        inverse = self.street.inverse_depth(frame)
        size = canvas.pinhole.width, canvas.pinhole.height
        if inverse.shape != size[::-1]:
            inverse = cv2.resize(inverse, size, interpolation=cv2.INTER_NEAREST)
        return PixelDepth(inverse)
