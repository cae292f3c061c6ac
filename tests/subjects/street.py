"""A person on a street, with a level ground below and a wall behind."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

from addon.core.base.arrays import Floats, Map, Mask
from addon.core.camera.intrinsics import Intrinsics
from addon.core.camera.reconstruction import Image

CAMERA = Intrinsics(320, 180, 260.0, 260.0, 160.0, 60.0)
EYE, WALL = 1.6, 0.05
"""Height of the camera over a level ground, and inverse depth of what is behind that."""


@dataclass(frozen=True)
class Street:
    """Plates of a street, seen from a place at each frame."""

    blind: frozenset[int] = frozenset()
    """Frames in which the ground is not seen."""
    deep: frozenset[int] = frozenset()
    """Those in which everything below the horizon is much too far, besides."""
    on_person: int = 0
    """Feature points across the person; there are 48 on both sides."""
    distance: float = 4.0
    """That of the points on the person."""

    @property
    def reconstruction(self) -> SimpleNamespace:
        sides = np.stack(np.meshgrid([-0.8, -0.7, 0.7, 0.8], np.linspace(-1, 1, 12), [4.5]), -1)
        own = np.stack(np.meshgrid(*(np.linspace(-0.15, 0.15, self.on_person),) * 2, [self.distance]), -1)
        xyz = np.concatenate([sides.reshape(-1, 3), own.reshape(-1, 3)])
        return SimpleNamespace(
            points=SimpleNamespace(xyz=xyz),
            intrinsics=lambda _image: CAMERA,
            image_at=lambda frame: (seeing(image(frame), xyz), None),
        )

    def canvas(self, frame: int) -> SimpleNamespace:
        return SimpleNamespace(pinhole=CAMERA, camera=CAMERA, features_from_source=lambda xy: xy)

    def on_canvas(self, image: Image, mask: Mask) -> Mask:
        return mask

    def inverse_depth(self, frame: int, left_out: object) -> Map:
        rows = np.arange(CAMERA.height) + 0.5 - CAMERA.cy
        ground = np.maximum(rows / CAMERA.fy / EYE, WALL)
        inverse = np.full(CAMERA.height, WALL) if frame in self.blind else ground
        if frame in self.deep:
            inverse = np.where(rows < 90, inverse, WALL / 4)
        return np.repeat(inverse[:, None], CAMERA.width, axis=1).astype(np.float32)


def image(frame: int) -> Image:
    """A camera that moves to the right."""
    nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
    return Image(frame, np.eye(3), np.array([-0.2 * frame, 0.0, 0.0]), *nothing)


def seeing(image: Image, xyz: Floats) -> Image:
    """The camera with those of points (n, 3) that it sees."""
    there = xyz @ image.rotation.T + image.translation
    at = there[:, :2] / there[:, 2:] * CAMERA.focal + CAMERA.principal_point
    inside = ((at > 0) & (at < (CAMERA.width, CAMERA.height))).all(axis=1)
    return replace(image, xy=at[inside], points=np.flatnonzero(inside))


def person(distance: float, frame: int) -> Mask:
    """(h, w) someone at x = 0, 1.7 high."""
    mask = np.zeros((CAMERA.height, CAMERA.width), bool)
    left, right = (round(CAMERA.cx + CAMERA.fx * (side - 0.2 * frame) / distance) for side in (-0.25, 0.25))
    foot, head = (round(CAMERA.cy + CAMERA.fy * y / distance) for y in (EYE, EYE - 1.7))
    mask[max(head, 0) : foot, left:right] = True
    return mask
