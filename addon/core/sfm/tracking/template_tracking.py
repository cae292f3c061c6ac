"""The appearance of tracked points, which keeps a track from drifting.

Flow from frame to frame adds up its small errors. The patch around a point is kept from the track's first
frame and found again in every later one under an affine map; a different appearance ends the track. Shi and
Tomasi, "Good features to track", 1994; Baker and Matthews, "Lucas-Kanade 20 years on", 2004 (the inverse
compositional algorithm: all derivatives are the old patch's).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Map, Mask

RADIUS = 6
"""Pixels from a patch's middle to its border."""
STIFFNESS = 0.3
"""Stiffness of the affine map, relative to the patch's evidence about its place. Chosen by inspection."""
BLOCK = 1 << 14
"""Patches that are sampled at once: OpenCV takes no picture with more rows than 15 bits count."""


def _basis() -> Map:
    """(3, p) of 1, u, v at the p pixels of a patch, row by row; its middle is (0, 0)."""
    axis = np.arange(-RADIUS, RADIUS + 1, dtype=np.float32)
    u, v = (side.ravel() for side in np.meshgrid(axis, axis))
    return np.stack([np.ones_like(u), u, v])


BASIS = _basis()
WEIGHT = np.exp(-(BASIS[1:] ** 2).sum(axis=0) / (2 * (0.9 * RADIUS) ** 2))
WEIGHT = (WEIGHT / WEIGHT.sum()).astype(np.float32)
# Chosen by inspection of clips with known motion, as in tests/sfm/test_tracks.py.
ITERATIONS = 2
"""Gauss-Newton steps towards the best fit; they start from the fit of the frame before."""
MAX_UNLIKE = 0.3
"""One minus the correlation with the first patch from which a point is something else."""
NOISE = 2.0
"""Multiple of the median unexplained variance that is put down to noise: weak patches have more of it."""
MAX_UNLIKE_WITH_NOISE = 0.7
"""As `MAX_UNLIKE`, whatever the noise."""
MAX_MOVE = 1.5
"""Pixels that a fit may move a point away from where the flow put it."""
MAX_STRETCH = 2.0
"""Determinant of the affine map, or its inverse, past which the patch is taken anew."""


@dataclass
class Rows:
    """Arrays with a row for each of the same n things."""

    def kept(self, rows: Mask | NDArray[np.integer]) -> Self:
        """Return the rows of a mask (n,), or of row numbers (k,) in their order."""
        return self._made(lambda value: value.kept(rows) if isinstance(value, Rows) else value[rows])

    def joined(self, other: Self) -> Self:
        """Return these rows, then the other's."""
        rest = (getattr(other, field.name) for field in fields(self))
        return self._made(
            lambda value: (
                value.joined(next(rest)) if isinstance(value, Rows) else np.concatenate([value, next(rest)])
            )
        )

    def _made(self, change: Callable[[Any], Any]) -> Self:
        return type(self)(*(change(getattr(self, field.name)) for field in fields(self)))


@dataclass
class Patches(Rows):
    """The patches of n points, row by row. Places are OpenCV's: (0, 0) is the middle of the first pixel."""

    known: Mask
    """(n,) false for a point whose patch has not been seen whole yet."""
    patch: Map
    """(n, p) of mean 0 and variance 1 under `WEIGHT`."""
    slope: Map
    """(n, 2, p) its derivatives along x and y."""
    inverse: Map
    """(n, 6, 6) of the normal equations, weighted."""
    map: Floats
    """(n, 2, 2) from the patch to the last frame seen."""

    @classmethod
    def unknown(cls, count: int) -> Patches:
        """Return patches of new points."""
        size = len(WEIGHT)
        return cls(
            np.zeros(count, bool), np.zeros((count, size), np.float32),
            np.zeros((count, 2, size), np.float32), np.zeros((count, 6, 6), np.float32),
            np.tile(np.eye(2), (count, 1, 1)),
        )  # fmt: skip

    def learn(self, gray: Map, places: Map) -> None:
        """Take the patches that are not known yet from a frame (H, W) with the points at (n, 2)."""
        rows = np.nonzero(~self.known)[0]
        rows = rows[_inside(gray, places[rows], np.tile(np.eye(2), (len(rows), 1, 1)))]
        if not len(rows):
            return
        at, upright = places[rows], np.tile(np.eye(2), (len(rows), 1, 1))
        patch, spread = _normalised(_sample(gray, at, upright))
        half = np.float32(0.5) * np.eye(2, dtype=np.float32)
        slope = np.stack(
            [_sample(gray, at + step, upright) - _sample(gray, at - step, upright) for step in half], 1
        )
        slope /= spread[:, None, None]
        both = (slope[:, :, None] * BASIS).reshape(len(rows), 6, -1)
        # Changes of brightness and contrast are no evidence about the place.
        both -= (both @ WEIGHT)[..., None]
        both -= (both * patch[:, None] @ WEIGHT)[..., None] * patch[:, None]
        normal = ((both * WEIGHT) @ both.swapaxes(1, 2)).astype(np.float64)
        weight = normal[:, 0, 0] + normal[:, 3, 3]
        stiff = np.array([1e-4, *[STIFFNESS * RADIUS**2] * 2] * 2)
        self.inverse[rows] = np.linalg.inv(normal + (weight[:, None] * stiff + 1e-9)[:, None] * np.eye(6))
        self.patch[rows], self.slope[rows] = patch, slope * WEIGHT
        self.map[rows], self.known[rows] = np.eye(2), True

    def refined(self, gray: Map, places: Map) -> tuple[Map, Mask]:
        """Refine places (n, 2) in a frame (H, W) by their patches; returns those (n,) that look alike.

        A point whose patch is not known, or not complete in this frame, stays and counts as alike.
        """
        rows = np.nonzero(self.known)[0]
        rows = rows[_inside(gray, places[rows], self.map[rows])]
        alike = np.ones(len(self.known), bool)
        if not len(rows):
            return places, alike
        at, turn = places[rows].astype(np.float64), self.map[rows]
        patch, slope, inverse = self.patch[rows], self.slope[rows], self.inverse[rows]
        for _ in range(ITERATIONS):
            seen, _ = _normalised(_sample(gray, at, turn))
            error = (seen - patch)[:, None] * slope @ BASIS.T
            step = np.einsum("nij,nj->ni", inverse, error.reshape(-1, 6)).astype(np.float64)
            shear = np.clip(step.reshape(-1, 2, 3)[:, :, 1:], -0.2, 0.2)
            turn = turn @ np.linalg.inv(np.eye(2) + shear)
            at -= np.einsum("nij,nj->ni", turn, np.clip(step[:, ::3], -1, 1))
        unlike, spread = _unlike(gray, at, turn, patch)
        noise = NOISE * np.median(unlike * spread**2) / spread**2
        alike[rows] = unlike < np.minimum(MAX_UNLIKE + noise, MAX_UNLIKE_WITH_NOISE)
        near = np.linalg.norm(at - places[rows], axis=1) < MAX_MOVE
        area = np.linalg.det(turn)
        steady = (area > 1 / MAX_STRETCH) & (area < MAX_STRETCH)
        good = near & steady & alike[rows]
        moved = places.copy()
        moved[rows[good]] = at[good]
        self.map[rows[good]] = turn[good]
        self.known[rows[~steady]] = False
        return moved, alike

    def unlike(self, gray: Map, places: Map) -> Map:
        """Return (n,) one minus the correlation of known patches with a frame (H, W) at places (n, 2)."""
        return _unlike(gray, places, self.map, self.patch)[0]


def _unlike(gray: Map, places: NDArray[np.floating], maps: Floats, patch: Map) -> tuple[Map, Map]:
    """(n,) one minus the correlation of patches (n, p) with a picture, and its standard deviations there."""
    seen, spread = _normalised(_sample(gray, places, maps))
    return 1 - (seen * patch) @ WEIGHT, spread


def _sample(gray: Map, places: NDArray[np.floating], maps: Floats) -> Map:
    """(n, p) the patches around places (n, 2) of a picture (H, W), seen through affine maps (n, 2, 2).

    Past the picture's border its last pixel goes on.
    """
    rows = np.concatenate([places[:, :, None], maps], axis=2).astype(np.float32)
    seen = []
    for start in range(0, len(rows), BLOCK):
        x, y = (rows[start : start + BLOCK, axis] @ BASIS for axis in (0, 1))
        seen.append(cv2.remap(gray, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    none = np.zeros((0, BASIS.shape[1]), np.float32)
    return np.asarray(seen[0] if len(seen) == 1 else np.concatenate([none, *seen]), np.float32)


def _normalised(patch: Map) -> tuple[Map, Map]:
    """Patches (n, p) with mean 0 and variance 1, and the standard deviations (n,) that they had."""
    centred = patch - (patch @ WEIGHT)[:, None]
    spread = np.sqrt(centred**2 @ WEIGHT) + np.float32(1e-3)
    return centred / spread[:, None], spread


def _inside(gray: Map, places: Map, maps: Floats) -> Mask:
    """(n,) which patches lie in the picture as a whole."""
    reach = RADIUS * np.abs(maps).sum(axis=2) + 1
    size = np.array(gray.shape[::-1]) - 1
    return np.asarray(np.all((places >= reach) & (places <= size - reach), axis=1))
