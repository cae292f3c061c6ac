"""The light that a clip's lens loses towards the corners, found from points that frames see elsewhere.

Goldman, "Vignette and exposure calibration and compensation", 2010: the logarithm of the loss is an even
polynomial of the distance from the middle, and what a point's brightness is drops out between two frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map
from ..camera.reconstruction import Intrinsics
from .plane_sweep import CLIPPED, FOOT

POWERS = np.array([2, 4, 6])
"""Powers of the distance from the middle in the polynomial."""
AROUND = 9
"""Pixels across the square whose mean is a point's brightness."""
FEWEST = 200
"""Least pairs of brightnesses for a fit."""
LEAST_LOSS = 0.1
"""Share of encoded light lost at the outermost points, up to which nothing is changed: clips that lose
none have fits of up to 0.06, by 250 points, and person_walk_away_1 has 0.25 to 0.31."""
STEPS = 5
"""Reweighted least squares until the weights stay."""


@dataclass(frozen=True)
class LightFalloff:
    """Loss of light in a lens, by the distance from the middle of the picture in half diagonals."""

    terms: Floats
    """(3,) factors of `POWERS` in the logarithm of the light that is left."""
    outermost: float
    """Distance of the outermost points; the loss beyond them is theirs."""

    def even(self, picture: Bytes, lens: Intrinsics) -> Bytes:
        """Return a display-encoded picture (h, w, 4) with as much light everywhere as in its middle."""
        height, width = picture.shape[:2]
        y, x = np.mgrid[:height, :width].astype(np.float32) + np.float32(0.5)
        distance = from_middle(np.stack([x, y], axis=-1), lens)
        gain = np.exp(-self.left(distance)).astype(np.float32)[..., None]
        rgb = (picture[..., :3] + np.float32(FOOT)) * gain - np.float32(FOOT)
        return np.dstack([np.clip(np.rint(rgb), 0, 255).astype(np.uint8), picture[..., 3]])

    def left(self, distance: Floats | Map) -> Floats:
        """Return the logarithm (...) of the light that is left at distances (...) from the middle."""
        return np.asarray(np.minimum(distance, self.outermost)[..., None] ** POWERS @ self.terms)


def from_middle(places: Floats | Map, lens: Intrinsics) -> Floats:
    """Return the distances (...) of places (..., 2) in pixels from the optical axis, in half diagonals."""
    half = np.hypot(lens.width, lens.height) / 2
    return np.asarray(np.linalg.norm(places - lens.principal_point, axis=-1) / half)


def light_falloff(seen: Sequence[tuple[Bytes, Intrinsics, Floats]]) -> LightFalloff | None:
    """Find what the lens loses from the same points in several frames; None where it loses hardly anything.

    Args:
        seen: For a frame and each neighbour, the picture (h, w, 4), display-encoded, its pinhole, and the
            places (n, 2) of the points in it.
    """
    light, distance = (np.stack(each) for each in zip(*(_measured(*one) for one in seen), strict=True))
    step = np.where(light[1:] - light[0] == 0, 1e-9, light[1:] - light[0])
    known = np.isfinite(step)
    if known.sum() < FEWEST:
        return None
    # Unknowns: the factors of `POWERS`, and a change of exposure of each neighbour.
    neighbour = np.nonzero(known)[0]
    apart = (distance[1:, :, None] ** POWERS - distance[0][:, None] ** POWERS)[known]
    system = np.column_stack([apart, np.eye(len(step))[neighbour]])
    right, weight = step[known], np.ones(len(neighbour))
    for _ in range(STEPS):
        fit = np.linalg.lstsq(system * weight[:, None], right * weight, rcond=None)[0]
        off = np.abs(right - system @ fit)
        weight = 1 / np.sqrt(1 + (off / max(2 * np.median(off), 1e-6)) ** 2)
    outermost = float(np.percentile(distance[:, known.any(axis=0)], 99))
    found = LightFalloff(fit[: len(POWERS)], outermost)
    left = found.left(np.linspace(0, outermost, 20))
    # A lens only loses light, and the more the farther out.
    if left[-1] > np.log(1 - LEAST_LOSS) or np.diff(left).max() > -np.log(1 - LEAST_LOSS) / 2:
        return None
    return found


def _measured(picture: Bytes, lens: Intrinsics, places: Floats) -> tuple[Floats, Floats]:
    """(n,) logarithm of light around places, NaN where it is clipped or not seen; their distances (n,)."""
    gray = cv2.blur(cv2.cvtColor(picture[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32), (AROUND,) * 2)
    with np.errstate(invalid="ignore"):
        column, row = np.floor(np.nan_to_num(places, nan=-1.0)).clip(-1, 1 << 20).astype(int).T
    height, width = gray.shape
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    column, row = np.where(inside, column, 0), np.where(inside, row, 0)
    level = gray[row, column]
    clear = inside & (picture[row, column, 3] == 255) & (level < CLIPPED)
    return np.where(clear, np.log(level + FOOT), np.nan), from_middle(
        np.where(inside[:, None], places, 0.0), lens
    )
