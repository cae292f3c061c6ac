"""A lens of every camera model that is read."""

from __future__ import annotations

from addon.core.camera.distortion import PARAMETERS
from addon.core.camera.reconstruction import Intrinsics

WIDTH, HEIGHT = 640, 480
TERMS: dict[str, tuple[float, ...]] = {
    "SIMPLE_PINHOLE": (),
    "PINHOLE": (),
    "SIMPLE_RADIAL": (-0.12,),
    "RADIAL": (-0.12, 0.03),
    "OPENCV": (-0.12, 0.03, 0.002, -0.003),
    "OPENCV_FISHEYE": (0.05, -0.02, 0.003, -0.001),
    "FULL_OPENCV": (0.3, 0.05, 0.001, -0.002, 0.01, 0.35, 0.04, 0.01),
    "SIMPLE_RADIAL_FISHEYE": (-0.03,),
    "RADIAL_FISHEYE": (-0.03, 0.01),
    "SIMPLE_FISHEYE": (),
    "FISHEYE": (),
}  # fmt: skip
"""A lens of every model, strong enough for every term to show."""


def values_of(model: str) -> tuple[float, ...]:
    """Parameters in COLMAP's order, with different focal lengths where there are two."""
    focal = (410.0,) if PARAMETERS[model][0] == "f" else (410.0, 425.0)
    return (*focal, 325.0, 236.0, *TERMS[model])


def lens_of(model: str) -> Intrinsics:
    return Intrinsics.from_parameters(model, WIDTH, HEIGHT, values_of(model))
