"""Intrinsic parameters of a camera: focal lengths, principal point and distortion, in COLMAP's models.

Camera axes are x right, y down, z forward; the centre of the first pixel is at (0.5, 0.5). All geometry is
float64.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.errors import UserError
from . import distortion
from .distortion import Floats
from .rolling_shutter import RollingShutter

MAX_SIDE = 1_000_000
"""Pixels; a larger picture is damage, not a picture."""


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole with the distortion of its lens; without distortion terms a plain pinhole."""

    width: int
    """Pixels across the picture."""
    height: int
    """Pixels down the picture."""
    fx: float
    """Focal length in pixel widths."""
    fy: float
    """Focal length in pixel heights."""
    cx: float
    """Principal point in pixels from the picture's left edge."""
    cy: float
    """Principal point in pixels from the picture's top edge."""
    k1: float = 0.0
    """First radial term of the model OPENCV; 0 in any other."""
    k2: float = 0.0
    """Second radial term of the model OPENCV; 0 in any other."""
    p1: float = 0.0
    """First tangential term of the model OPENCV; 0 in any other."""
    p2: float = 0.0
    """Second tangential term of the model OPENCV; 0 in any other."""
    model: str = "OPENCV"
    """One of `distortion.FAMILIES`."""
    terms: tuple[float, ...] = ()
    """All distortion terms of any other model than OPENCV, in COLMAP's order."""
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector in radians by which the camera turns from this frame to the next, in its own axes."""
    largest_turn: float = 0.0
    """Largest such turn of the clip, in radians: its margin gives all canvases of the clip one size."""
    readout: tuple[float, float] = (0.0, 0.0)
    """Time in which a rolling shutter reads the picture's width and its height, of the time from a frame to
    the next; positive where what is farther right or down is read later."""

    def __post_init__(self) -> None:
        own = self.model == "OPENCV"
        count = 0 if own else len(distortion.term_names(self.model))
        if self.model not in distortion.FAMILIES or len(self.terms) != count:
            raise ValueError(f"{self.model} is not a known lens model with {len(self.terms)} terms")
        if not own and any((self.k1, self.k2, self.p1, self.p2)):
            raise ValueError(f"the distortion of a lens {self.model} is in its terms, not in k1 to p2")

    @classmethod
    def from_parameters(cls, model: str, width: int, height: int, values: Sequence[float]) -> Intrinsics:
        """Return the camera of one of COLMAP's models and its parameters in COLMAP's order.

        Raises:
            UserError: The model has no pinhole picture, the number of parameters is wrong, a size or focal
                length is not greater than zero, or a value is not finite. The message begins with "expected".
        """
        families = distortion.FAMILIES
        family = next((name for name, members in families.items() if model in members), None)
        if family is None:
            known = ", ".join(itertools.chain(*families.values()))
            raise UserError(
                f"expected a camera model that is one of {known}, not {model[:40]}; undistort the pictures,"
                " or cut flat ones out of a panorama, and solve these"
            )
        names = distortion.PARAMETERS[model]
        if len(values) != len(names):
            raise UserError(f"expected {len(names)} parameters of {model}, not {len(values)}")
        if not np.all(np.isfinite(values)):
            raise UserError("expected finite camera parameters")
        given = dict(zip(names, (float(value) for value in values), strict=True))
        fx, fy = (given.pop("f"),) * 2 if "f" in given else (given.pop("fx"), given.pop("fy"))
        if not (0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and fx > 0 and fy > 0):
            raise UserError(
                f"expected a size from 1 to {MAX_SIDE} pixels and focal lengths greater than zero"
            )
        cx, cy = given.pop("cx"), given.pop("cy")
        terms = tuple(given.get(name, 0.0) for name in distortion.term_names(family))
        if family == "OPENCV":
            k1, k2, p1, p2 = terms
            return cls(width, height, fx, fy, cx, cy, k1, k2, p1, p2)
        return cls(width, height, fx, fy, cx, cy, model=family, terms=terms)

    def parameters(self) -> tuple[str, tuple[float, ...]]:
        """Return the simplest of COLMAP's models of this lens, and its parameters in COLMAP's order."""
        own = {name: getattr(self, name) for name in distortion.PLACES[1:]} | self._named_terms
        for model in distortion.FAMILIES[self.model]:
            names = distortion.PARAMETERS[model]
            left_out = [value for name, value in self._named_terms.items() if name not in names]
            if not any(left_out) and (self.fx == self.fy or "f" not in names):
                return model, tuple(float(own["fx" if name == "f" else name]) for name in names)
        raise AssertionError("the last model of a family has all its terms")

    @property
    def _named_terms(self) -> dict[str, float]:
        names = distortion.term_names(self.model)
        own = self.model == "OPENCV"
        return dict(zip(names, (getattr(self, name) for name in names) if own else self.terms, strict=True))

    @cached_property
    def _lens(self) -> tuple[distortion.Stage, ...]:
        return distortion.stages(self.model, tuple(self._named_terms.values()))

    @cached_property
    def _stages(self) -> tuple[distortion.Stage | RollingShutter, ...]:
        if not any(self.readout):
            return self._lens
        rate = np.asarray(self.readout) / [self.width, self.height]
        start = float(rate @ (self.principal_point - np.array([self.width, self.height]) / 2))
        across, down = (rate * self.focal).tolist()
        return (RollingShutter(self._lens, self.turn, (across, down), start),)

    @property
    def is_distorted(self) -> bool:
        """Return whether the camera differs from a pinhole with a global shutter."""
        return bool(self._stages)

    @property
    def focal(self) -> Floats:
        """(2,) focal lengths fx, fy in pixels."""
        return np.array([self.fx, self.fy])

    @property
    def principal_point(self) -> Floats:
        """(2,) principal point cx, cy in pixels."""
        return np.array([self.cx, self.cy])

    @property
    def most_read_away(self) -> float:
        """Radians that the camera turns between the middle of the picture and its corners at most."""
        return self.largest_turn * sum(map(abs, self.readout)) / 2

    def scaled(self, width: int, height: int) -> Intrinsics:
        """Return this camera with its picture resampled to width x height pixels."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self, width=width, height=height,
            fx=self.fx * sx, cx=self.cx * sx, fy=self.fy * sy, cy=self.cy * sy,
        )  # fmt: skip

    def read_at_once(self) -> Intrinsics:
        """Return the same camera with a global shutter, at the time of the middle of its picture."""
        return replace(self, turn=(0.0, 0.0, 0.0), largest_turn=0.0, readout=(0.0, 0.0))

    def without_distortion(self) -> Intrinsics:
        """Return the pinhole of the same size in pixels, focal lengths and principal point."""
        return Intrinsics(self.width, self.height, self.fx, self.fy, self.cx, self.cy)

    def described(self) -> str:
        """Return the lens's distortion for people: "OPENCV, k1 -0.1, k2 0, p1 0, p2 0"."""
        return ", ".join([self.model, *(f"{name} {value:g}" for name, value in self._named_terms.items())])

    def distort(self, rays: Floats) -> Floats:
        """Normalised pinhole coordinates (..., 2) -> normalised coordinates seen through the lens.

        NaN where the lens sees nothing.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for stage in self._stages:
                rays = stage.distort(rays)
        return rays

    def distort_jacobian(self, rays: Floats) -> Floats:
        """Return the derivative (..., 2, 2) of `distort` at rays (..., 2), with a global shutter."""
        result = np.broadcast_to(np.eye(2), (*rays.shape, 2))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for stage in self._lens:
                result = stage.jacobian(rays) @ result
                rays = stage.distort(rays)
        return result

    def undistort(self, rays: Floats) -> Floats:
        """Return undistorted rays: the inverse of `distort`; (..., 2) -> (..., 2), to about 1e-12.

        They are NaN where no ray ahead of the camera is seen: past a fold, or 90 degrees from the axis.
        """
        rays = np.array(rays, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for stage in reversed(self._stages):
                rays = stage.undistort(rays)
        return rays

    def rays(self, pixels: Floats) -> Floats:
        """Return the rays (..., 3) of depth 1 through pixels (..., 2) of the lens without distortion."""
        at = (pixels - self.principal_point) / self.focal
        return np.concatenate([at, np.ones((*at.shape[:-1], 1))], axis=-1)

    def project(self, points: Floats) -> Floats:
        """Project camera-space points (..., 3) to pixels (..., 2) of the source frame.

        They are not finite at depth 0. A point behind the camera lands at its mirror image: check the depth.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            rays = points[..., :2] / points[..., 2:]
            return np.asarray(self.distort(rays) * self.focal + self.principal_point)

    def pinhole_pixels(self, pixels: Floats) -> Floats:
        """Return pixels of the source frame (..., 2) in the same lens without distortion."""
        if not self.is_distorted:
            return np.array(pixels, dtype=np.float64)
        rays = self.undistort((pixels - self.principal_point) / self.focal)
        return rays * self.focal + self.principal_point
