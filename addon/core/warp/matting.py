"""Matting of mixed pixels: alpha and colours of the two surfaces at a silhouette."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, LinearRGBA, Map, Mask
from ..base.progress import checkpoint

CHUNK = 1 << 13
"""Mixed pixels processed at once, so that their sums stay in a processor's cache."""
SEEN_DOUBT = 0.05
"""Variance of background colours from other frames over that of estimated foreground colours. On the
composites of `alpha_crops` it gains 0.6 to 1.4 dB with estimated mattes and 0.8 to 3.6 dB with true ones."""
SEARCH_RADIUS = 3
"""Pixels around a mixed one in which its surfaces are searched."""
VARIANCE_WEIGHT = 4.0
"""Factor from the variance of colours beside a silhouette to that across it. Chosen by looking at frames,
with bars and foreground of `python -m benchmarks.accuracy`."""
THIN_PIXELS = 6
"""Least neighbouring pixels of a thin object. Chosen by looking at frames of the same scenes."""
THIN_RADIUS = 7
"""Pixels along a thin object that give its colour."""
REPROJECTED_RESIDUAL = 0.05
"""Distance of colours (linear light) by which colours of other frames may explain a mixed pixel worse than
those beside it. Chosen by looking at frames; with other frames' colours blocks go from 77 to 80 % of the gap
closed to the oracle at edges (32 px, true depth)."""
MOST_THROUGH = 0.5
"""Alpha of a given matte from which on a pixel does not determine the colour behind it."""
LEAST_CONTRAST = 0.02
"""Least distance of two colours (linear light) that determines a mixed pixel's alpha."""


@dataclass(frozen=True)
class Surfaces:
    """The two surfaces that share each of n mixed pixels, as seen beside them."""

    row: Indices
    column: Indices
    """(n,) columns of the mixed pixels."""
    near: Floats
    """(n, 3) mean colour of the near surface."""
    far: Floats
    """(n, 3) mean colour of the far surface."""
    near_variance: Floats
    """(n,) of the near surface's colour."""
    far_variance: Floats
    """(n,) of the far surface's colour."""
    near_disparity: Floats
    """(n,) of the near surface, in pixels."""
    far_disparity: Floats
    """(n,) of the far surface, in pixels."""
    alpha: Floats
    """(n,) of the near surface by its depth: 0 or 1."""
    exists: Mask
    """(n,) whether there is a near surface: thin objects of too few pixels are dropped."""


def surfaces_beside(picture: LinearRGBA, disparity: Map, mixed: Mask, jump: float) -> Surfaces:
    """Find the surfaces beside mixed pixels (H, W) of a picture (H, W, 4) with disparities (H, W)."""
    row, column = np.nonzero(mixed)
    own = disparity[row, column]
    around = np.ones((3, 3), np.uint8)
    low, high = (extreme(disparity, around)[row, column] for extreme in (cv2.erode, cv2.dilate))
    middle = np.float32(0.5) * (high + low)
    # Disparities outside belong to a third surface.
    bounds = np.stack([low - np.float32(jump), middle, high + np.float32(jump)])
    sides = _sums(picture, disparity, ~mixed, row, column, bounds)
    thin = sides[0].weight == 0
    lacking = np.flatnonzero(thin | (sides[1].weight == 0))
    everything = np.ones_like(mixed)
    instead = _sums(picture, disparity, everything, row[lacking], column[lacking], bounds[:, lacking])
    for side, other in zip(sides, instead, strict=True):
        without = side.weight[lacking] == 0
        side.sums[:, lacking[without]] = other.sums[:, without]
    colour = picture[row, column, :3]
    near, near_disparity, near_variance = sides[0].means(colour, own, high)
    far, far_disparity, far_variance = sides[1].means(colour, own, low)
    near[thin], near_variance[thin], count = _thin(
        picture, disparity, row[thin], column[thin], near_disparity[thin], jump
    )
    exists = np.ones(len(row), bool)
    exists[thin] = count >= THIN_PIXELS
    # The presence of a thin object shows in its colour alone.
    alpha = ((own > middle) & ~thin).astype(np.float64)
    return Surfaces(
        row, column, near, far, near_variance, far_variance, near_disparity, far_disparity, alpha, exists
    )


def with_reprojected(surfaces: Surfaces, colour: LinearRGB, far: LinearRGB, known: Mask) -> Surfaces:
    """Return surfaces with the far one's colours (n, 3) from other frames where these are as good.

    `colour` (n, 3) are the pixels, of which the `known` (n,) have such colours.
    """

    def unexplained(far: Floats | LinearRGB) -> Floats:
        alpha = np.clip(_on_line(colour, surfaces.near, far), 0, 1)[:, None]
        return np.asarray(((colour - alpha * surfaces.near - (1 - alpha) * far) ** 2).sum(axis=1))

    known = known & (unexplained(far) <= unexplained(surfaces.far) + REPROJECTED_RESIDUAL**2)
    colours = np.where(known[:, None], far.astype(np.float64), surfaces.far)
    return replace(surfaces, far=colours, far_variance=np.where(known, 0, surfaces.far_variance))


def _on_line(colour: LinearRGB, near: Floats, far: Floats | LinearRGB) -> Floats:
    """Return (n,) positions of colours (n, 3) on the line from far ones, 0, to near ones, 1."""
    line = near - far
    return np.asarray(((colour - far) * line).sum(axis=1) / np.maximum((line**2).sum(axis=1), 1e-12))


def matted(colour: LinearRGB, surfaces: Surfaces) -> tuple[Map, LinearRGB, LinearRGB]:
    """Divide mixed pixels (n, 3) between the two surfaces beside them, which together always give the pixel.

    Alpha follows from the position of a pixel's colour on the line between the colours of both surfaces
    (Ruzon and Tomasi, "Alpha estimation in natural images", 2000).

    Returns:
        Alpha (n,) of the near surface, its premultiplied colour (n, 3), and the far surface's colour (n, 3).
    """
    far = surfaces.far
    length = ((surfaces.near - far) ** 2).sum(axis=1)
    alpha = _on_line(colour, surfaces.near, far)
    # If the surfaces have similar or varied colours, depth alone determines alpha.
    spread = VARIANCE_WEIGHT * (surfaces.near_variance + surfaces.far_variance)
    trust = length / (length + LEAST_CONTRAST**2 + spread)
    alpha = np.clip(trust * alpha + (1 - trust) * surfaces.alpha, 0, 1) * surfaces.exists
    opaque = np.asarray(alpha, np.float32)
    return opaque, *parted(colour, opaque, far)


def behind(colour: LinearRGB, alpha: Map, near: LinearRGB) -> LinearRGB:
    """Return the far surface's colour (n, 3) in pixels (n, 3) that a near one covers by alpha (n,) < 1."""
    share = alpha[:, None]
    return np.asarray(np.maximum(colour - share * near, 0) / (1 - share), np.float32)


def corrected(colour: LinearRGB, alpha: Map, near: LinearRGB, far: LinearRGB) -> LinearRGB:
    """Correct a background's colours `far` (n, 3) from other frames by the pixels (n, 3) themselves.

    The remaining difference from a foreground `near` (n, 3) of alpha (n,) is attributed to the background at
    low alpha: crowds move, and other frames are registered to a pixel or two. The result (n, 3) is the most
    likely background if both have errors, by `SEEN_DOUBT`.
    """
    own, rest = alpha[:, None], (1 - alpha)[:, None]
    missed = colour - own * near - rest * far
    share = SEEN_DOUBT * rest / (own**2 + SEEN_DOUBT * rest**2)
    return np.asarray(np.maximum(far + share * missed, 0), np.float32)


def parted(colour: LinearRGB, alpha: Map, far: Floats | LinearRGB) -> tuple[LinearRGB, LinearRGB]:
    """Return the colours (n, 3) of both surfaces, which together give the pixels (n, 3).

    `alpha` (n,) is that of the near surface, whose colour is premultiplied; `far` (n, 3) is the expected
    colour of the other.
    """
    front = np.maximum(colour - (1 - alpha)[:, None] * far, 0)
    # A pixel darker than the far surface's share makes the far surface darker, too.
    far = np.minimum(far, colour / np.maximum(1 - alpha, 1e-6)[:, None])
    return front.astype(np.float32), far.astype(np.float32)


def _thin(
    picture: LinearRGBA, disparity: Map, row: Indices, column: Indices, near: Floats, jump: float
) -> tuple[Floats, Floats, Floats]:
    """Return mean colour (n, 3), variance (n,) and number of pixels (n,) along thin objects."""
    offset = np.arange(-THIN_RADIUS, THIN_RADIUS + 1)
    y = np.clip(row[:, None, None] + offset[:, None], 0, disparity.shape[0] - 1)
    x = np.clip(column[:, None, None] + offset, 0, disparity.shape[1] - 1)
    along = (np.abs(disparity[y, x] - near[:, None, None]) < jump).astype(np.float32)
    checkpoint(0.3)
    colours = picture[y, x, :3]
    count = along.sum(axis=(1, 2))
    mean = np.einsum("nij,nijc->nc", along, colours) / np.maximum(count, 1)[:, None]
    squared = np.einsum("nij,nijc->n", along, colours**2) / np.maximum(count, 1)
    return mean, np.maximum(squared - (mean**2).sum(axis=1), 0), count


@dataclass(frozen=True)
class _Sums:
    """Weighted sums over pixels around n mixed ones, relative to those for float32."""

    sums: Map
    """(6, n) of weights, three channels of colour, their squared lengths, and disparities."""

    @property
    def weight(self) -> Map:
        return np.asarray(self.sums[0])

    def means(self, colour: LinearRGB, disparity: Map, otherwise: Map) -> tuple[Floats, Floats, Floats]:
        """Means of colours (n, 3) and disparities (n,), and variance (n,); black and `otherwise` if empty."""
        some = self.weight > 0
        mean = self.sums[1:].astype(np.float64) / np.where(some, self.weight, 1)
        variance = np.maximum(mean[3] - (mean[:3] ** 2).sum(axis=0), 0)
        middle = np.where(some[:, None], mean[:3].T + colour, 0)
        return middle, np.where(some, mean[4] + disparity, otherwise), variance


def _neighbours(row: Indices, column: Indices, dy: int, dx: int, shape: tuple[int, ...]) -> Indices:
    """Return (n,) indices of neighbours in a raveled raster, clipped to its border."""
    return np.clip(row + dy, 0, shape[0] - 1) * shape[1] + np.clip(column + dx, 0, shape[1] - 1)


def _sums(
    picture: LinearRGBA, disparity: Map, among: Mask, row: Indices, column: Indices, bounds: Map
) -> tuple[_Sums, _Sums]:
    """Sums weighted by distance around n mixed pixels, for both surfaces between bounds (3, n)."""
    found = np.zeros((2, 6, len(row)), np.float32)
    colours, depths, counts = picture.reshape(-1, picture.shape[2]), disparity.ravel(), among.ravel()
    for first in range(0, len(row), CHUNK):
        checkpoint(0.3)
        some = slice(first, first + CHUNK)
        (low, middle, high), y, x = bounds[:, some], row[some], column[some]
        own = _neighbours(y, x, 0, 0, disparity.shape)
        own_colour, own_depth = colours[own].T[:3].copy(), depths[own]
        there, product = np.ones((2, 6, len(y)), np.float32)
        for dy in range(-SEARCH_RADIUS, SEARCH_RADIUS + 1):
            for dx in range(-SEARCH_RADIUS, SEARCH_RADIUS + 1):
                at = _neighbours(y, x, dy, dx, disparity.shape)
                depth = depths[at]
                np.subtract(colours[at].T[:3], own_colour, out=there[1:4])
                np.einsum("cn,cn->n", there[1:4], there[1:4], out=there[4])
                np.subtract(depth, own_depth, out=there[5])
                weight = counts[at] * np.float32(1 / (1 + dy**2 + dx**2))
                is_near = depth > middle
                for total, side in zip(
                    found, (is_near & (depth <= high), ~is_near & (depth >= low)), strict=True
                ):
                    total[:, some] += np.multiply(there, weight * side, out=product)
    return _Sums(found[0]), _Sums(found[1])
