"""A rolling shutter behind a lens, for a camera that turns while its picture is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats, Indices
from .distortion import Stage

READINGS = 20
"""Most repetitions to find the time at which a ray is read; a turn of 3 degrees in a reading takes 8."""
SETTLED = 1e-10
"""Change of normalised coordinates at which it is found."""


@dataclass(frozen=True)
class RollingShutter:
    """A lens behind which a picture is read row by row, or column by column, while the camera turns.

    It takes rays of the camera as it stands when the middle of the picture is read. Turns are all that it
    knows: within a reading, a camera moves by far less than a pixel's parallax. Forssen and Ringaby,
    "Rectifying rolling shutter video from hand-held devices", 2010.
    """

    lens: tuple[Stage, ...]
    """Distortion of rays by the lens."""
    turn: tuple[float, float, float]
    """Rotation vector from a frame to the next in camera axes, in radians."""
    rate: tuple[float, float]
    """Time from x = 0 to x = 1, and from y = 0 to y = 1, at which coordinates behind the lens are read, of
    the time from a frame to the next."""
    start: float
    """That of (0, 0), after the middle of the picture."""

    def distort(self, rays: Floats) -> Floats:
        """Return rays (..., 2) as they are read.

        The time depends on the place: it is iterated until it stays.
        """
        flat = rays.reshape(-1, 2)
        seen = self._through_lens(flat).copy()
        turning = _Turning.of(np.stack([flat[:, 0], flat[:, 1], np.ones(len(flat))]), self.turn)
        left = np.arange(len(seen))
        for _ in range(READINGS):
            last = seen[left]
            x, y, z = turning.among(left).at(self._when(last))
            seen[left] = now = self._through_lens(np.stack([x / z, y / z], axis=-1))
            left = left[np.any(np.abs(now - last) > SETTLED, axis=-1)]
            if not len(left):
                break
        return seen.reshape(rays.shape)

    def undistort(self, rays: Floats) -> Floats:
        """Return the rays (..., 2) that `distort` moves to given rays at known times; NaN without one."""
        when = self._when(rays)
        for stage in reversed(self.lens):
            rays = stage.undistort(rays)
        ahead = turned(np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1), self.turn, -when)
        return np.asarray(ahead[..., :2] / np.where(ahead[..., 2:] > 0, ahead[..., 2:], np.nan))

    def _when(self, seen: Floats) -> Floats:
        return np.asarray(seen @ np.asarray(self.rate) + self.start)

    def _through_lens(self, rays: Floats) -> Floats:
        for stage in self.lens:
            rays = stage.distort(rays)
        return rays


def turned(points: Floats, turn: Sequence[float] | Floats, when: Floats) -> Floats:
    """Return points (..., 3) in the axes of a camera that turns by (..., 3) radians in a time of one.

    `when` (...) has the times.
    """
    return np.moveaxis(_Turning.of(np.moveaxis(points, -1, 0), turn).at(when), 0, -1).copy()


@dataclass(frozen=True)
class _Turning:
    """Points (3, ...) in the axes of a turning camera (Rodrigues); NumPy is slower with coordinates last."""

    points: Floats
    """(3, ...) at time 0."""
    across: Floats
    """(3, ...) cross products of the turn's axis with the points."""
    along: Floats
    """(3, ...) their parts along the axis."""
    angle: Floats
    """(...) radians in a time of one."""

    @classmethod
    def of(cls, points: Floats, turn: Sequence[float] | Floats) -> _Turning:
        """Prepare turning points (3, ...), by a rotation vector (..., 3) in radians for a time of one."""
        angle = np.linalg.norm(turn, axis=-1, keepdims=True)
        a, b, c = axis = np.moveaxis(turn / np.where(angle > 0, angle, 1.0), -1, 0)
        x, y, z = points
        along = a * x + b * y + c * z
        across = np.stack([b * z - c * y, c * x - a * z, a * y - b * x])
        return cls(points, across, np.stack([along * one for one in axis]), angle[..., 0])

    def among(self, which: Indices) -> _Turning:
        """Return some of the points (3, n), with the same turn for all."""
        if len(which) == self.points.shape[1]:
            return self
        return _Turning(self.points[:, which], self.across[:, which], self.along[:, which], self.angle)

    def at(self, when: Floats) -> Floats:
        """Return (3, ...) at times (...)."""
        angle = self.angle * np.asarray(when)
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.stack([
            cosine * point + sine * across + (1 - cosine) * along
            for point, across, along in zip(self.points, self.across, self.along, strict=True)
        ])  # fmt: skip
