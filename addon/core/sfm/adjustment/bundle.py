"""Cameras, points and observations of a bundle adjustment, and their residuals.

Points are homogeneous, so that infinity is not a special case. The lens bends a pinhole's picture, and rows
and columns are read one after the other while the camera turns. Brown, "Close-range camera calibration",
1971; Forssen and Ringaby, "Rectifying rolling shutter video from hand-held devices", 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...base.arrays import Floats, Ints, Mask

SIGMA = np.array([0.03, 0.03, 0.1, 0.05, 0.5, 0.5])
"""Standard deviations of `Distortion.parameters` a priori. Chosen by inspection, and wide."""
LOSS, LEAST_LOSS = 2.0, 0.01
"""Pixels from which a loss bends, over the median error, and at least. Where a walker has 6 % of the tracks,
points are off by 4.2 % in the median with a loss of one pixel, by 1.2 with this, by 1.4 with 3 times."""
LIMITS = np.array([0.2, 0.2, 0.5, 0.5, 1.0, 1.0])
"""Largest magnitudes of them: a frame is read before the next one is, and past the others no lens is one."""


@dataclass(frozen=True)
class Distortion:
    """Distortion and readout of all frames of a clip. Places are pixels from the middle of the picture.

    By default it is that of a pinhole that reads all rows at once.
    """

    size: tuple[int, int]
    """Width and height of the picture in pixels."""
    speed: Floats
    """(F, 3) rotation vector from a frame to the next, in camera axes."""
    parameters: Floats = field(default_factory=lambda: np.zeros(len(SIGMA)))
    """(6,) principal point x, y in half diagonals; k1, k2: a place at m half diagonals from it is seen at m
    (1 + k1 |m|^2 + k2 |m|^4); time to read the width and the height, in frame intervals."""
    free: Mask = field(default_factory=lambda: np.ones(len(SIGMA), bool))
    """(6,) which of the parameters an adjustment may change."""

    @property
    def half_diagonal(self) -> float:
        """Pixels."""
        return float(np.hypot(*self.size)) / 2

    def turned(self, local: Floats, frame: Ints, xy: Floats) -> Floats:
        """Return points (m, 3) in the axes of cameras `frame` (m,), when the places xy (m, 2) are read."""
        when = xy @ (self.parameters[4:] / self.size)
        return np.asarray(local + np.cross(self.speed[frame] * when[:, None], local))

    def bent(self, place: Floats) -> Floats:
        """Return the distorted places (m, 2) of a pinhole's places."""
        place = place / self.half_diagonal
        square = (place**2).sum(axis=1, keepdims=True)
        k1, k2 = self.parameters[2:4]
        return np.asarray(
            self.half_diagonal * (self.parameters[:2] + place * (1 + k1 * square + k2 * square**2))
        )

    def derivatives(self, local: Floats, focal: Floats, frame: Ints, xy: Floats) -> tuple[Floats, Floats]:
        """Return derivatives of bent places by a pinhole's places (m, 2, 2) and by the parameters (m, 2, 6).

        Args:
            local: (m, 3) points after `turned`, ahead of the camera.
            focal: (m,) in pixels.
            frame: (m,) numbers.
            xy: (m, 2) observed places.
        """
        unit, (k1, k2) = self.half_diagonal, self.parameters[2:4]
        place = focal[:, None] / unit * local[:, :2] / local[:, 2:]
        square = (place**2).sum(axis=1)[:, None]
        outer = place[:, :, None] * place[:, None, :]
        by_place = (1 + k1 * square + k2 * square**2)[..., None] * np.eye(2)
        by_place = by_place + (2 * k1 + 4 * k2 * square)[..., None] * outer
        when = xy / self.size
        spin = np.cross(self.speed[frame], local)
        # The derivative of the turn, up to the third order.
        spin = spin - (when @ self.parameters[4:])[:, None] * np.cross(self.speed[frame], spin)
        slide = (focal[:, None] * spin[:, :2] - unit * place * spin[:, 2:]) / local[:, 2:]
        slide = np.einsum("mij,mj->mi", by_place, slide)
        by_parameters = np.empty((len(local), 2, len(SIGMA)))
        by_parameters[..., :2] = unit * np.eye(2)
        by_parameters[..., 2], by_parameters[..., 3] = unit * place * square, unit * place * square**2
        by_parameters[..., 4], by_parameters[..., 5] = slide * when[:, :1], slide * when[:, 1:]
        return by_place, by_parameters * self.free

    def changed(self, step: Floats) -> Distortion:
        """With the parameters (6,) that much larger, within what cameras have."""
        return replace(self, parameters=np.clip(self.parameters + step, -LIMITS, LIMITS))


@dataclass(frozen=True)
class Observations:
    """Where points are seen: m observations, sorted in any way, at most one of a point in a frame."""

    frame: Ints
    """(m,) 0 to F - 1."""
    point: Ints
    """(m,) 0 to P - 1."""
    xy: Floats
    """(m, 2) pixels from the principal point."""


@dataclass(frozen=True)
class Bundle:
    """Cameras and points, in any units."""

    rotation: Floats
    """(F, 3, 3) world-to-camera."""
    translation: Floats
    """(F, 3)"""
    points: Floats
    """(P, 4) homogeneous, of unit length."""
    focal: Floats
    """(F,) pixels."""
    distortion: Distortion | None = None
    """None for pinholes that read a picture at once."""

    @property
    def world(self) -> Floats:
        """(P, 3) points; not finite where they are infinitely far."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.points[:, :3] / self.points[:, 3:])

    def in_camera(self, seen: Observations) -> Floats:
        """Return (m, 3) each observation's point in its camera's axes, times its own homogeneous factor."""
        turned = np.einsum("mij,mj->mi", self.rotation[seen.frame], self.points[seen.point, :3])
        local = np.asarray(turned + self.points[seen.point, 3:] * self.translation[seen.frame])
        return local if self.distortion is None else self.distortion.turned(local, seen.frame, seen.xy)

    def residuals(self, seen: Observations) -> Floats:
        """Return (m, 2) projection minus observation, in pixels."""
        return self.residuals_at(self.in_camera(seen), seen)

    def residuals_at(self, local: Floats, seen: Observations) -> Floats:
        """Return (m, 2) projection minus observation, in pixels, of points `in_camera` (m, 3)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            place = self.focal[seen.frame, None] * local[:, :2] / local[:, 2:]
        return np.asarray((place if self.distortion is None else self.distortion.bent(place)) - seen.xy)


def loss_of(errors: Floats) -> float:
    """Return the pixels from which a robust loss bends, for errors (m,) of observations."""
    return max(LOSS * float(np.nanmedian(errors)), LEAST_LOSS)


def weights(residuals: Floats, loss: float) -> tuple[Floats, float]:
    """Return Huber's weights (m,) and the cost."""
    size = np.linalg.norm(residuals, axis=1)
    bad = ~np.isfinite(size)
    size = np.where(bad, 1e6, size)
    weight = np.where(size <= loss, 1.0, loss / np.maximum(size, loss))
    return np.where(bad, 0.0, weight), float(np.where(size <= loss, size**2, 2 * loss * size - loss**2).sum())


def cost_of(bundle: Bundle, seen: Observations, loss: float, tie: float) -> float:
    """Return the robust cost of residuals and priors, in pixels squared."""
    return weights(robust_residuals(bundle, seen)[0], loss)[1] + prior_cost(bundle, loss, tie)


def prior_cost(bundle: Bundle, loss: float, tie: float) -> float:
    """Return the cost of the priors of focal lengths and distortion."""
    cost = tie * float((np.diff(np.log(bundle.focal)) ** 2).sum())
    if bundle.distortion is not None:
        cost += float(((bundle.distortion.parameters * loss / SIGMA) ** 2).sum())
    return cost


def robust_residuals(bundle: Bundle, seen: Observations) -> tuple[Floats, Floats]:
    """Return residuals (m, 2) in pixels, NaN behind the camera, and points in camera axes (m, 3).

    A point behind the camera would fit as well.
    """
    local = bundle.in_camera(seen)
    residuals = bundle.residuals_at(local, seen)
    residuals[local[:, 2] <= 0] = np.nan
    return residuals, local
