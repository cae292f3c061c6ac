"""Cameras, points and observations of a bundle adjustment, and their residuals.

Points are homogeneous, so that infinity is not a special case.
"""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats, Ints
from .distortion import SIGMA, Distortion


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
