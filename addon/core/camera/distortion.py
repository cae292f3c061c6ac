"""The camera models of COLMAP: where a lens puts what a pinhole would see elsewhere.

A model is a chain of stages between normalised pinhole coordinates (x / z, y / z) and the normalised
coordinates seen through the lens. A stage scales along the radius in closed form (`Arc`, `Division`,
`Sphere`) or is a polynomial (`Brown`), whose inverse is Newton's. Only rays ahead of the camera are known.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.arrays import Floats as Floats

PARAMETERS: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k1"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        "fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3",
    ),
    "SIMPLE_DIVISION": ("f", "cx", "cy", "k"),
    "DIVISION": ("fx", "fy", "cx", "cy", "k"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
    "EUCM": ("fx", "fy", "cx", "cy", "alpha", "beta"),
    "EQUIRECTANGULAR": ("width", "height"),
}  # fmt: skip
"""Names of COLMAP's parameters in its order; a model's place here is its number in binary files."""
FAMILIES: dict[str, tuple[str, ...]] = {
    "OPENCV": ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"),
    "OPENCV_FISHEYE": (
        "SIMPLE_FISHEYE", "FISHEYE", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "OPENCV_FISHEYE",
    ),
    "FULL_OPENCV": ("FULL_OPENCV",),
    "FOV": ("FOV",),
    "THIN_PRISM_FISHEYE": ("THIN_PRISM_FISHEYE",),
    "RAD_TAN_THIN_PRISM_FISHEYE": ("RAD_TAN_THIN_PRISM_FISHEYE",),
    "DIVISION": ("SIMPLE_DIVISION", "DIVISION"),
    "EUCM": ("EUCM",),
}  # fmt: skip
"""The models that we compute with, and those that are one with some terms zero, the simplest first."""
PLACES = ("f", "fx", "fy", "cx", "cy")


def term_names(model: str) -> tuple[str, ...]:
    """Return the names of a model's distortion terms, in COLMAP's order."""
    return tuple(name for name in PARAMETERS[model] if name not in PLACES)


class Stage(Protocol):
    """A map of the plane (..., 2) -> (..., 2) that leaves the origin where it is."""

    def distort(self, rays: Floats) -> Floats:
        """Return rays (..., 2) as this stage moves them."""

    def jacobian(self, rays: Floats) -> Floats:
        """Return (..., 2, 2) derivative at rays (..., 2)."""

    def undistort(self, rays: Floats) -> Floats:
        """Return the rays (..., 2) that `distort` moves to given rays (..., 2); NaN without one."""


class Radial(ABC):
    """A stage that scales along the radius by a function of its square, invertible in closed form."""

    @abstractmethod
    def scale(self, square: Floats) -> tuple[Floats, Floats]:
        """Factor (...) at squared radii (...), and its derivative (...) by the squared radius."""

    @abstractmethod
    def inverse_scale(self, square: Floats) -> Floats:
        """Factor (...) back, at squared radii (...) after distortion; NaN where no ray ahead gets there."""

    def distort(self, rays: Floats) -> Floats:
        return np.asarray(rays * self.scale(_square(rays))[0][..., None])

    def jacobian(self, rays: Floats) -> Floats:
        factor, slope = self.scale(_square(rays))
        outer = rays[..., :, None] * rays[..., None, :]
        return np.asarray(factor[..., None, None] * np.eye(2) + 2 * slope[..., None, None] * outer)

    def undistort(self, rays: Floats) -> Floats:
        return np.asarray(rays * self.inverse_scale(_square(rays))[..., None])


@dataclass(frozen=True)
class Arc(Radial):
    """Radius atan(inner r) / outer.

    1 and 1 is the angle to the axis, where every fisheye begins; 2 tan(omega / 2) and omega is Devernay
    and Faugeras, "Straight lines have to be straight", 2001.
    """

    inner: float = 1.0
    outer: float = 1.0

    def scale(self, square: Floats) -> tuple[Floats, Floats]:
        q = self.inner**2 * square
        # Towards the centre the quotients lose their digits and the series has them all.
        near = q < 1e-6
        safe = np.where(near, 1.0, q)
        share = np.where(near, 1 - q / 3 + q * q / 5, np.arctan(np.sqrt(safe)) / np.sqrt(safe))
        slope = np.where(near, -1 / 3 + 2 * q / 5, (1 / (1 + safe) - share) / (2 * safe))
        factor = self.inner / self.outer
        return factor * share, factor * self.inner**2 * slope

    def inverse_scale(self, square: Floats) -> Floats:
        angle = abs(self.outer) * np.sqrt(square)
        near = angle < 1e-6
        safe = np.where(near | (angle >= np.pi / 2), 1.0, angle)
        share = np.where(near, 1 + angle * angle / 3, np.tan(safe) / safe)
        return np.where(angle < np.pi / 2, self.outer / self.inner * share, np.nan)


@dataclass(frozen=True)
class Division(Radial):
    """Undistorted radius r / (1 + k r^2).

    Fitzgibbon, "Simultaneous linear estimation of multiple view geometry and lens distortion", 2001.
    """

    k: float

    def scale(self, square: Floats) -> tuple[Floats, Floats]:
        root = np.sqrt(1 - 4 * self.k * square)
        return 2 / (1 + root), 4 * self.k / (root * (1 + root) ** 2)

    def inverse_scale(self, square: Floats) -> Floats:
        # Past 1 a larger radius would belong to a smaller angle: the picture is folded there.
        bend = self.k * square
        return 1 / np.where(np.abs(bend) < 1, 1 + bend, np.nan)


@dataclass(frozen=True)
class Sphere(Radial):
    """Projection by an ellipsoid. Khomutenko, Garcia, Martinet, "An enhanced unified camera model", 2016."""

    alpha: float
    beta: float

    def scale(self, square: Floats) -> tuple[Floats, Floats]:
        distance = np.sqrt(self.beta * square + 1)
        factor = 1 / (self.alpha * distance + 1 - self.alpha)
        return factor, -(factor**2) * self.alpha * self.beta / (2 * distance)

    def inverse_scale(self, square: Floats) -> Floats:
        q = self.beta * square
        depth = (1 - self.alpha**2 * q) / (
            self.alpha * np.sqrt(1 - (2 * self.alpha - 1) * q) + 1 - self.alpha
        )
        return 1 / np.where(depth > 0, depth, np.nan)


@dataclass(frozen=True)
class Brown:
    """Radial, tangential and thin-prism polynomials.

    Brown, "Decentering distortion of lenses", 1966; with OpenCV's rational radial term and with the prism
    of Weng, Cohen, Herniou, "Camera calibration with distortion models", 1992.
    """

    radial: tuple[float, ...]
    """Coefficients of r^2, r^4, ... above the fraction line of the radial factor, after its 1."""
    tangential: tuple[float, float] = (0.0, 0.0)
    """p1 and p2."""
    below: tuple[float, ...] = ()
    """Coefficients of r^2, r^4, ... below the fraction line."""
    prism: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Coefficients of r^2 and r^4 towards x, then towards y."""

    def distort(self, rays: Floats) -> Floats:
        x, y = rays[..., 0], rays[..., 1]
        q = x * x + y * y
        factor, _ = self._factor(q)
        p1, p2 = self.tangential
        u, v = x * factor, y * factor
        if any(self.tangential):
            u = u + (2 * p1 * x * y + p2 * (q + 2 * x * x))
            v = v + (p1 * (q + 2 * y * y) + 2 * p2 * x * y)
        if any(self.prism):
            a, b, c, d = self.prism
            u, v = u + q * (a + b * q), v + q * (c + d * q)
        return np.stack([u, v], axis=-1)

    def jacobian(self, rays: Floats) -> Floats:
        x, y = rays[..., 0], rays[..., 1]
        q = x * x + y * y
        factor, slope = self._factor(q)
        p1, p2 = self.tangential
        a, b, c, d = self.prism
        change = 2 * slope
        across, down = 2 * (a + 2 * b * q), 2 * (c + 2 * d * q)
        both = change * x * y + 2 * p1 * x + 2 * p2 * y
        xx = factor + change * x * x + 2 * p1 * y + 6 * p2 * x + across * x
        yy = factor + change * y * y + 6 * p1 * y + 2 * p2 * x + down * y
        rows = [np.stack([xx, both + across * y], axis=-1), np.stack([both + down * x, yy], axis=-1)]
        return np.stack(rows, axis=-2)

    def undistort(self, rays: Floats) -> Floats:
        """Return undistorted rays (..., 2) by Newton's method, to about 1e-12.

        They are NaN where it does not converge: no ray is seen past a fold.
        """
        guess = np.array(rays, dtype=np.float64)
        for _ in range(20):
            residual = rays - self.distort(guess)
            (xx, xy), (yx, yy) = np.moveaxis(self.jacobian(guess), (-2, -1), (0, 1))
            det = xx * yy - xy * yx
            det = np.where(np.abs(det) < 1e-9, 1.0, det)
            u, v = residual[..., 0], residual[..., 1]
            move = np.stack([(u * yy - v * xy) / det, (v * xx - u * yx) / det], axis=-1)
            guess = guess + move
            if not move.size or np.abs(move).max() < 1e-13:
                break
        found = np.linalg.norm(rays - self.distort(guess), axis=-1, keepdims=True) < 1e-9
        return np.where(found, guess, np.nan)

    def _factor(self, q: Floats) -> tuple[Floats, Floats]:
        above, rise = _polynomial(self.radial, q)
        if not any(self.below):
            return above, rise
        under, fall = _polynomial(self.below, q)
        factor = above / under
        return factor, (rise - factor * fall) / under


def stages(model: str, terms: Sequence[float]) -> tuple[Stage, ...]:
    """Return the chain of a family of `FAMILIES`, terms in COLMAP's order; empty for a pinhole."""
    t = tuple(float(term) for term in terms)
    match model:
        case "OPENCV":
            chain: tuple[Stage, ...] = (Brown(t[:2], (t[2], t[3])),)
        case "FULL_OPENCV":
            chain = (Brown((t[0], t[1], t[4]), (t[2], t[3]), t[5:8]),)
        case "OPENCV_FISHEYE":
            chain = (Arc(), Brown(t))
        case "THIN_PRISM_FISHEYE":
            chain = (Arc(), Brown((t[0], t[1], t[4], t[5]), (t[2], t[3]), prism=(t[6], 0.0, t[7], 0.0)))
        case "RAD_TAN_THIN_PRISM_FISHEYE":
            chain = (Arc(), Brown(t[:6]), Brown((), (t[7], t[6]), prism=(t[8], t[9], t[10], t[11])))
        case "FOV":
            chain = (Arc(2 * np.tan(t[0] / 2), t[0]),) if t[0] else ()
        case "DIVISION":
            chain = (Division(t[0]),) if t[0] else ()
        case "EUCM":
            chain = (Sphere(*t),) if t[0] else ()
        case _:
            raise ValueError(f"{model} is not a known lens model")
    return tuple(stage for stage in chain if not (isinstance(stage, Brown) and _does_nothing(stage)))


def impossible(model: str, terms: Sequence[float]) -> str | None:
    """Return the requirement on a family's terms that no lens can miss; None if it is met."""
    if not np.all(np.isfinite(terms)):
        return "finite distortion terms"
    if model == "FOV" and not abs(terms[0]) < np.pi:
        return "an omega of less than pi"
    if model == "EUCM" and not (0 <= terms[0] <= 1 and terms[1] > 0):
        return "an alpha from 0 to 1 and a beta greater than zero"
    return None


def _does_nothing(stage: Brown) -> bool:
    return not any((*stage.radial, *stage.tangential, *stage.below, *stage.prism))


def _square(rays: Floats) -> Floats:
    return np.asarray((rays * rays).sum(axis=-1))


def _polynomial(coefficients: Sequence[float], q: Floats) -> tuple[Floats, Floats]:
    """1 + c0 q + c1 q^2 + ... and its derivative."""
    value, slope = np.zeros_like(q), np.zeros_like(q)
    for coefficient in reversed(coefficients):
        slope = value + q * slope
        value = coefficient + q * value
    return 1 + q * value, value + q * slope
