"""The camera models of COLMAP: where a lens puts what a pinhole would see elsewhere.

A model is a chain of stages between normalised pinhole coordinates (x / z, y / z) and the normalised
coordinates seen through the lens: the angle to the axis of a fisheye (`Arc`) in closed form, and a polynomial
(`Brown`), whose inverse is Newton's. Only rays ahead of the camera are known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

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
}  # fmt: skip
"""The models that we compute with, and those that are one with some terms zero, the simplest first. Others
are refused: no guide to a program that we import from leads to one."""
PLACES = ("f", "fx", "fy", "cx", "cy")


def term_names(model: str) -> tuple[str, ...]:
    """Return the names of a model's distortion terms, in COLMAP's order."""
    return tuple(name for name in PARAMETERS[model] if name not in PLACES)


class Arc:
    """The angle to the axis in place of its tangent, where every fisheye begins."""

    def distort(self, rays: Floats) -> Floats:
        return np.asarray(rays * self._scale(rays)[0][..., None])

    def jacobian(self, rays: Floats) -> Floats:
        factor, slope = self._scale(rays)
        outer = rays[..., :, None] * rays[..., None, :]
        return np.asarray(factor[..., None, None] * np.eye(2) + 2 * slope[..., None, None] * outer)

    def undistort(self, rays: Floats) -> Floats:
        angle = np.sqrt(_square(rays))
        near = angle < 1e-6
        safe = np.where(near | (angle >= np.pi / 2), 1.0, angle)
        share = np.where(near, 1 + angle * angle / 3, np.tan(safe) / safe)
        return np.asarray(rays * np.where(angle < np.pi / 2, share, np.nan)[..., None])

    def _scale(self, rays: Floats) -> tuple[Floats, Floats]:
        """Factor (...) of rays (..., 2), and its derivative by the squared radius."""
        q = _square(rays)
        # Towards the centre the quotients lose their digits and the series has them all.
        near = q < 1e-6
        safe = np.where(near, 1.0, q)
        factor = np.where(near, 1 - q / 3 + q * q / 5, np.arctan(np.sqrt(safe)) / np.sqrt(safe))
        return factor, np.where(near, -1 / 3 + 2 * q / 5, (1 / (1 + safe) - factor) / (2 * safe))


@dataclass(frozen=True)
class Brown:
    """Radial and tangential polynomials.

    Brown, "Decentering distortion of lenses", 1966; with OpenCV's rational radial term.
    """

    radial: tuple[float, ...]
    """Coefficients of r^2, r^4, ... above the fraction line of the radial factor, after its 1."""
    tangential: tuple[float, float] = (0.0, 0.0)
    """p1 and p2."""
    below: tuple[float, ...] = ()
    """Coefficients of r^2, r^4, ... below the fraction line."""

    def distort(self, rays: Floats) -> Floats:
        x, y = rays[..., 0], rays[..., 1]
        q = x * x + y * y
        factor, _ = self._factor(q)
        p1, p2 = self.tangential
        u, v = x * factor, y * factor
        if any(self.tangential):
            u = u + (2 * p1 * x * y + p2 * (q + 2 * x * x))
            v = v + (p1 * (q + 2 * y * y) + 2 * p2 * x * y)
        return np.stack([u, v], axis=-1)

    def jacobian(self, rays: Floats) -> Floats:
        x, y = rays[..., 0], rays[..., 1]
        q = x * x + y * y
        factor, slope = self._factor(q)
        p1, p2 = self.tangential
        change = 2 * slope
        both = change * x * y + 2 * p1 * x + 2 * p2 * y
        xx = factor + change * x * x + 2 * p1 * y + 6 * p2 * x
        yy = factor + change * y * y + 6 * p1 * y + 2 * p2 * x
        return np.stack([np.stack([xx, both], axis=-1), np.stack([both, yy], axis=-1)], axis=-2)

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


Stage = Arc | Brown
"""A map of the plane (..., 2) -> (..., 2) that leaves the origin where it is, its derivative and inverse."""


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
        case _:
            raise ValueError(f"{model} is not a known lens model")
    return tuple(
        stage
        for stage in chain
        if not isinstance(stage, Brown) or any((*stage.radial, *stage.tangential, *stage.below))
    )


def _square(rays: Floats) -> Floats:
    return np.asarray((rays * rays).sum(axis=-1))


def _polynomial(coefficients: Sequence[float], q: Floats) -> tuple[Floats, Floats]:
    """1 + c0 q + c1 q^2 + ... and its derivative."""
    value, slope = np.zeros_like(q), np.zeros_like(q)
    for coefficient in reversed(coefficients):
        slope = value + q * slope
        value = coefficient + q * value
    return 1 + q * value, value + q * slope
