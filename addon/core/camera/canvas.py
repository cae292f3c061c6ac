"""Undoing lens distortion before the warp, and putting it back afterwards."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map
from ..base.errors import UserError
from .intrinsics import Intrinsics

MAX_PADDING = 0.5
"""Share of the side that can be padded on either side at most: strong barrel distortion sends corners to
infinity. A canvas has up to four times the picture's pixels."""
STEPS = 33
"""Places from the principal point to each place of the border at which a lens is tested for folds."""
KEPT_LENSES = 8
"""Lenses whose border is remembered, 400 kB each: those of a clip at the sizes that it is worked at."""
CHUNK = 256
"""Rows that are resampled at once, as their places in double precision take more room than the picture."""
NODES = 48
"""Chebyshev nodes along each side. At 640x360 and 854x480, 17 lens models are within 3e-11 pixels of the
lens, and within 8e-10 with a rolling shutter, whose repetition ends near there."""
TESTED = 7
"""Places along each side at which the polynomial is compared with the map."""
LARGEST_ERROR = 1e-7
"""Pixels, beyond which the map itself is evaluated: a 600th of the last digit of a float32 of 1,000."""
KEPT_SIDES = 32
"""Lengths of sides whose weights are remembered, 0.4 MB each."""


@dataclass(frozen=True)
class Canvas:
    """The pinhole picture in which views are drawn.

    It is the source lens without its distortion, padded until every source pixel has a place. Without
    distortion it is the source frame itself and nothing is resampled.
    """

    camera: Intrinsics
    """The source lens at the size of the rendered frame."""

    @cached_property
    def pinhole(self) -> Intrinsics:
        """The padded canvas as a distortion-free lens; UserError for a lens that cannot be."""
        if not np.all(np.isfinite(self.camera.focal) & (self.camera.focal > 0)):
            raise UserError(
                f"the focal length is {self.camera.fx:g}, {self.camera.fy:g} pixels;"
                " it must be greater than zero"
            )
        plain = self.camera.without_distortion()
        if not self.camera.is_distorted:
            return plain
        width, height = self.camera.width, self.camera.height
        lens = _reach(self.camera.read_at_once())
        size = np.array([width, height])
        padding = np.stack([-lens.border.min(axis=0), lens.border.max(axis=0) - size])
        padding += self._turning(lens.border)
        reach = self.camera.pinhole_pixels(_border(width, height))
        if np.isnan(reach).any() or lens.folds_of(self.camera) or np.any(padding > MAX_PADDING * size):
            raise UserError(
                f"the lens ({self.camera.described()}) bends the picture's border beyond what a flat picture"
                f" can show: it folds, lies 90 degrees from the axis, or would take more than"
                f" {1 + 2 * MAX_PADDING:g} times the side; solve the clip again, or crop or undistort it and"
                " give a reconstruction of that"
            )
        before, after = np.ceil(np.maximum(padding, 0)).astype(int)
        return replace(
            plain,
            width=width + int(before[0] + after[0]), height=height + int(before[1] + after[1]),
            cx=plain.cx + float(before[0]), cy=plain.cy + float(before[1]),
        )  # fmt: skip

    def _turning(self, reach: Floats) -> float:
        """Pixels by which a rolling shutter moves pinhole pixels (n, 2) at most, in any frame of the clip."""
        radius = np.linalg.norm((reach - self.camera.principal_point) / self.camera.focal, axis=1)
        away = np.arctan(radius) + self.camera.most_read_away
        moved = np.where(away < np.pi / 2, np.tan(away), np.inf) - radius
        return float(moved.max() * self.camera.focal.max())

    def features_from_source(self, xy: Floats) -> Floats:
        """Source pixels (n, 2) -> canvas pixels (n, 2)."""
        return self.camera.pinhole_pixels(xy) + (self.pinhole.principal_point - self.camera.principal_point)

    def features_to_source(self, xy: Floats) -> Floats:
        """Canvas pixels (n, 2) -> source pixels (n, 2)."""
        rays = (xy - self.pinhole.principal_point) / self.pinhole.focal
        return np.asarray(self.camera.distort(rays) * self.camera.focal + self.camera.principal_point)

    def from_source(self, picture: LinearRGBA) -> LinearRGBA:
        """Resample a frame (H, W, 4) or (H, W), float32, to the canvas, mirrored where the lens was blind."""
        if not self.camera.is_distorted:
            return picture
        return _resampled(picture, self._in_source, self.pinhole.height)

    def canvas_map(self) -> Map:
        """Return where the source frame shows the canvas's pixels (h, w, 2), for `cv2.remap`.

        NaN where the lens sees nothing.
        """
        return np.asarray(self._in_source.rows(0, self.pinhole.height) - 0.5, np.float32)

    def source_map(self) -> Map:
        """Return where the canvas shows the source frame's pixels (H, W, 2), for `cv2.remap`."""
        return np.asarray(self._in_canvas.rows(0, self.camera.height) - 0.5, np.float32)

    @property
    def _in_source(self) -> SmoothPlaces:
        return SmoothPlaces(self.pinhole.width, self.pinhole.height, self.features_to_source)

    @property
    def _in_canvas(self) -> SmoothPlaces:
        return SmoothPlaces(self.camera.width, self.camera.height, self.features_from_source)

    def to_source(self, picture: LinearRGBA) -> LinearRGBA:
        """Resample a canvas picture (h, w, 4) or (h, w), float32, into the geometry of the source frame."""
        if not self.camera.is_distorted:
            return picture
        return _resampled(picture, self._in_canvas, self.camera.height)


@dataclass(frozen=True)
class _Reach:
    """The field of view of a lens with a global shutter."""

    border: Floats
    """(n, 2) pinhole pixels of places along the picture's border."""
    rays: Floats
    """(s, n, 2) normalised pinhole coordinates from the principal point to the border."""
    jacobian: Floats
    """(s, n, 2, 2) derivative of the lens's `distort` there."""

    @cached_property
    def folds(self) -> bool:
        """Return whether the lens maps two rays to one place; it does not while it mirrors nothing."""
        with np.errstate(over="ignore", invalid="ignore"):
            return not bool(np.all(np.linalg.det(self.jacobian) > 0))

    def folds_of(self, camera: Intrinsics) -> bool:
        """Return whether this lens folds the picture with the rolling shutter of a camera.

        The shutter folds where the picture moves along the reading direction as fast as it is read: a ray is
        then read twice, or never. Where it moves as fast against it, `RollingShutter.distort` does not
        converge.
        """
        if self.folds or not any(camera.turn):
            return self.folds
        x, y = self.rays[..., 0], self.rays[..., 1]
        turn_x, turn_y, turn_z = camera.turn
        along = turn_x * y - turn_y * x
        flow = np.stack([turn_y - turn_z * y - x * along, turn_z * x - turn_x - y * along], axis=-1)
        rate = np.asarray(camera.readout) / [camera.width, camera.height] * camera.focal
        return not bool(np.all(np.abs(np.sum(rate @ self.jacobian * flow, axis=-1)) < 1))


@lru_cache(KEPT_LENSES)
def _reach(lens: Intrinsics) -> _Reach:
    """The reach of a lens with a global shutter; NaN where it sees nothing."""
    border = lens.pinhole_pixels(_border(lens.width, lens.height))
    rays = np.linspace(0, 1, STEPS)[:, None, None] * ((border - lens.principal_point) / lens.focal)
    return _Reach(border, rays, lens.distort_jacobian(rays))


def _border(width: int, height: int) -> Floats:
    """(260, 2) pixels along the border of a picture."""
    across, down = np.linspace(0, width, 65), np.linspace(0, height, 65)
    return np.concatenate([
        np.stack(np.meshgrid(across, [0.0, height]), axis=-1).reshape(-1, 2),
        np.stack(np.meshgrid([0.0, width], down), axis=-1).reshape(-1, 2),
    ])  # fmt: skip


def _resampled(picture: LinearRGBA, places: SmoothPlaces, height: int) -> LinearRGBA:
    """A picture (H, W, 4) or (H, W) at `places` of `height` rows, mirrored past its border."""
    found = []
    for first, last in itertools.pairwise([*range(0, height, CHUNK), height]):
        # OpenCV counts from the centre of the first pixel, COLMAP from its corner. Lanczos keeps the
        # sharpness that two bilinear passes would lose; its overshoot below black is cut.
        at = (places.rows(first, last) - 0.5).astype(np.float32)
        how = cv2.INTER_LANCZOS4
        sampled = cv2.remap(picture, at, None, how, borderMode=cv2.BORDER_REFLECT)  # type: ignore[call-overload]
        found.append(np.asarray(np.maximum(sampled, 0), dtype=np.float32))
    return np.concatenate(found)


class SmoothPlaces:
    """The places of a picture's pixel centres under a map, such as a lens's distortion.

    A polynomial through the places of a few Chebyshev nodes (Trefethen, "Approximation theory and
    approximation practice", 2013) takes a fiftieth of the time that a rolling shutter takes for each pixel.
    Where it misses the map, as past a fold, the map is evaluated at each pixel.
    """

    def __init__(self, width: int, height: int, place: Callable[[Floats], Floats]) -> None:
        """Fit `place`, from pixels (..., 2) to pixels (..., 2), on a picture of a size in pixels."""
        self._width, self._place = width, place
        self._across, self._down = _weights(width), _weights(height)
        x, y = _nodes(width), _nodes(height)
        nodes = place(np.stack(np.meshgrid(x, y), axis=-1))
        self._nodes = nodes if np.isfinite(nodes).all() and self._fits(nodes, height) else None

    def _fits(self, nodes: Floats, height: int) -> bool:
        columns, rows = (np.linspace(0, n - 1, TESTED).astype(int) for n in (self._width, height))
        true = self._place(np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1))
        found = _interpolated(nodes, self._across[columns], self._down[rows])
        return bool(np.all(np.abs(found - true) <= LARGEST_ERROR))

    def rows(self, first: int, last: int) -> Floats:
        """Return the places (last - first, width, 2) of the pixels of some rows."""
        if self._nodes is not None:
            return _interpolated(self._nodes, self._across, self._down[first:last])
        return self._place(
            np.stack(np.meshgrid(np.arange(self._width) + 0.5, np.arange(first, last) + 0.5), axis=-1)
        )


def _interpolated(nodes: Floats, across: Floats, down: Floats) -> Floats:
    """(h, w, 2) of values at nodes (NODES, NODES, 2), by weights (w, NODES) and (h, NODES)."""
    # OpenBLAS's threads wait for each other here, for eight times the processor time.
    x, y = (
        cv2.gemm(cv2.gemm(down, one, 1, None, 0), across, 1, None, 0, flags=cv2.GEMM_2_T)
        for one in np.moveaxis(nodes, -1, 0).copy()
    )
    return np.asarray(cv2.merge([x, y]), np.float64)


def _nodes(count: int) -> Floats:
    """(NODES,) pixels of the nodes along a side of `count` pixels."""
    return (1 + np.cos(_ANGLES)) / 2 * count


@lru_cache(KEPT_SIDES)
def _weights(count: int) -> Floats:
    """(count, NODES) weights of the values at the nodes for the centres of `count` pixels."""
    angles = np.arccos(2 * (np.arange(count) + 0.5) / count - 1)
    scale = np.where(_DEGREES == 0, 1, 2) / NODES
    return np.cos(np.outer(angles, _DEGREES)) @ (scale[:, None] * np.cos(np.outer(_DEGREES, _ANGLES)))


_DEGREES = np.arange(NODES)
_ANGLES = (np.arange(NODES) + 0.5) * np.pi / NODES
