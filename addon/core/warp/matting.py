"""Mixed pixels: how much of each the nearer one of the two surfaces covers that meet at a silhouette."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, LinearRGBA, Map, Mask
from ..base.progress import checkpoint

CHUNK = 1 << 13
"""Mixed pixels that are looked at at once, so that what is summed of them stays in a processor's cache."""


@dataclass(frozen=True)
class MattingOptions:
    """When a mixed pixel's alpha follows from its colour, and when from its depth."""

    search_radius: int = 3
    """Pixels around a mixed one in which its two surfaces are looked for. By eye."""
    variance_weight: float = 4.0
    """How much more a surface's colours vary across a silhouette than beside it, in variances. By eye, with
    bars and foreground of `python -m benchmarks.accuracy`."""
    thin_pixels: int = 6
    """Pixels that something thin must have near each other to be one. By eye, with the same scenes."""
    thin_radius: int = 7
    """Pixels along something thin from which its colour is taken. By eye."""
    reprojected_residual: float = 0.05
    """Distance of colours (linear light) by which what other frames saw may explain a mixed pixel worse than
    what is beside it. By eye; with other frames' colours blocks go from 77 to 80 % of the gap closed to the
    oracle at edges (32 px, true depth)."""
    least_contrast: float = 0.02
    """Distance of two colours (linear light) from which on they tell a mixed pixel's alpha. By eye."""


@dataclass(frozen=True)
class Surfaces:
    """The two surfaces that share each of n mixed pixels, as they are beside them."""

    row: Indices
    """(n,) of the mixed pixels."""
    column: Indices
    """(n,) of the mixed pixels."""
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
    """(n,) of the near surface, as far as depth tells: 0 or 1."""
    exists: Mask
    """(n,) whether there is a near surface: of something thin, too few pixels may be near each other."""


def surfaces_beside(
    picture: LinearRGBA, disparity: Map, mixed: Mask, jump: float, options: MattingOptions
) -> Surfaces:
    """The surfaces beside the mixed pixels (H, W) of a picture (H, W, 4) with disparities (H, W)."""
    row, column = np.nonzero(mixed)
    own = disparity[row, column]
    low, high = _extremes(disparity, row, column)
    middle = (high + low) / 2
    # What is nearer or farther still belongs to a third surface.
    bounds = np.stack([low - jump, middle, high + jump])
    radius = options.search_radius
    sides = _means(picture, disparity, ~mixed, row, column, bounds, radius)
    thin = sides[0].weight == 0
    lacking = np.flatnonzero(thin | (sides[1].weight == 0))
    everything = np.ones_like(mixed)
    instead = _means(
        picture, disparity, everything, row[lacking], column[lacking], bounds[:, lacking], radius
    )
    for side, other in zip(sides, instead, strict=True):
        side.replace(lacking[side.weight[lacking] == 0], other.part(side.weight[lacking] == 0))
    near, near_disparity, near_variance = sides[0].means(high)
    far, far_disparity, far_variance = sides[1].means(low)
    near[thin], near_variance[thin], count = _thin(
        picture, disparity, row[thin], column[thin], near_disparity[thin], jump, options.thin_radius
    )
    exists = np.ones(len(row), bool)
    exists[thin] = count >= options.thin_pixels
    # That something thin is there at all, only its colour tells.
    alpha = ((own > middle) & ~thin).astype(np.float64)
    return Surfaces(
        row, column, near, far, near_variance, far_variance, near_disparity, far_disparity, alpha, exists
    )


def with_reprojected(
    surfaces: Surfaces, colour: LinearRGB, far: LinearRGB, known: Mask, options: MattingOptions
) -> Surfaces:
    """Surfaces beside n pixels, with the far one's own colours (n, 3) where they are known (n,), and explain
    the pixels' colours (n, 3) as well as those beside."""

    def unexplained(far: Floats | LinearRGB) -> Floats:
        alpha = np.clip(_on_line(colour, surfaces.near, far), 0, 1)[:, None]
        return np.asarray(((colour - alpha * surfaces.near - (1 - alpha) * far) ** 2).sum(axis=1))

    known = known & (unexplained(far) <= unexplained(surfaces.far) + options.reprojected_residual**2)
    colours = np.where(known[:, None], far.astype(np.float64), surfaces.far)
    return replace(surfaces, far=colours, far_variance=np.where(known, 0, surfaces.far_variance))


def _on_line(colour: LinearRGB, near: Floats, far: Floats | LinearRGB) -> Floats:
    """(n,) where colours (n, 3) lie on the line from far ones (n, 3), 0, to near ones (n, 3), 1."""
    line = near - far
    return np.asarray(((colour - far) * line).sum(axis=1) / np.maximum((line**2).sum(axis=1), 1e-12))


def matted(
    colour: LinearRGB, surfaces: Surfaces, options: MattingOptions
) -> tuple[Map, LinearRGB, LinearRGB]:
    """Alpha (n,) of the near surface in n mixed pixels (n, 3), its premultiplied colour (n, 3), and the far
    surface's colour (n, 3).

    A pixel on the line between the colours of both surfaces beside it has its alpha by where it lies there
    (Ruzon and Tomasi, "Alpha estimation in natural images", 2000). Whatever alpha is, both surfaces together
    are the pixel as it was.
    """
    far = surfaces.far
    length = ((surfaces.near - far) ** 2).sum(axis=1)
    alpha = _on_line(colour, surfaces.near, far)
    # Where the surfaces look alike, or each of many colours, the depth alone tells.
    spread = options.variance_weight * (surfaces.near_variance + surfaces.far_variance)
    trust = length / (length + options.least_contrast**2 + spread)
    alpha = np.clip(trust * alpha + (1 - trust) * surfaces.alpha, 0, 1) * surfaces.exists
    front = np.maximum(colour - (1 - alpha)[:, None] * far, 0)
    # Where the pixel is darker than the far surface's share alone, that is darker there, too.
    far = np.minimum(far, colour / np.maximum(1 - alpha, 1e-6)[:, None])
    return alpha.astype(np.float32), front.astype(np.float32), far.astype(np.float32)


def _thin(
    picture: LinearRGBA,
    disparity: Map,
    row: Indices,
    column: Indices,
    near: Floats,
    jump: float,
    radius: int,
) -> tuple[Floats, Floats, Floats]:
    """(n, 3) the colour of something so thin that no pixel is its own: the mean along it; (n,) its variance;
    (n,) of how many pixels, within a radius around n rows and columns.

    `near` (n,) is its disparity. A single pixel of it may show more of what is behind.
    """
    offset = np.arange(-radius, radius + 1)
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
    """Weighted sums over pixels around n mixed ones."""

    weight: Floats
    """(n,) sum of weights."""
    colour: Floats
    """(3, n) of colours."""
    squared: Floats
    """(n,) of colours' squared lengths."""
    disparity: Floats
    """(n,) of disparities."""

    @classmethod
    def none(cls, count: int) -> _Sums:
        """Of no pixels yet."""
        return cls(np.zeros(count), np.zeros((3, count)), np.zeros(count), np.zeros(count))

    def part(self, which: slice | Mask) -> _Sums:
        """Of some of the mixed pixels; of a slice, those sums themselves."""
        return _Sums(self.weight[which], self.colour[:, which], self.squared[which], self.disparity[which])

    def add(self, weight: Floats, colour: Floats, squared: Floats, disparity: Map) -> None:
        """One more pixel beside each, with its weight (n,), colour (3, n), the square of that (n,) and its
        disparity (n,)."""
        np.add(self.weight, weight, out=self.weight)
        np.add(self.colour, weight * colour, out=self.colour)
        np.add(self.squared, weight * squared, out=self.squared)
        np.add(self.disparity, weight * disparity, out=self.disparity)

    def replace(self, which: Indices, others: _Sums) -> None:
        """Take others for some of the mixed pixels."""
        self.weight[which], self.colour[:, which] = others.weight, others.colour
        self.squared[which], self.disparity[which] = others.squared, others.disparity

    def means(self, otherwise: Floats) -> tuple[Floats, Floats, Floats]:
        """(n, 3) and (n,) means of colours and disparities, and (n,) the colours' variance; without any pixel
        the disparity is `otherwise` (n,)."""
        safe = np.maximum(self.weight, 1e-12)
        colour = self.colour / safe
        variance = np.maximum(self.squared / safe - (colour**2).sum(axis=0), 0)
        disparity = np.where(self.weight > 0, self.disparity / safe, otherwise)
        return np.ascontiguousarray(colour.T), disparity, variance


def _neighbours(row: Indices, column: Indices, dy: int, dx: int, shape: tuple[int, ...]) -> Indices:
    """(n,) indices in a raveled raster of what is beside pixels; past its border, those at it."""
    return np.clip(row + dy, 0, shape[0] - 1) * shape[1] + np.clip(column + dx, 0, shape[1] - 1)


def _extremes(disparity: Map, row: Indices, column: Indices) -> tuple[Floats, Floats]:
    """(n,) least and (n,) largest disparity of n pixels and those around."""
    kernel = np.ones((3, 3), np.uint8)
    low, high = (f(disparity, kernel)[row, column].astype(np.float64) for f in (cv2.erode, cv2.dilate))
    return low, high


def _means(
    picture: LinearRGBA,
    disparity: Map,
    among: Mask,
    row: Indices,
    column: Indices,
    bounds: Floats,
    radius: int,
) -> tuple[_Sums, _Sums]:
    """Sums over the pixels in a mask (H, W) around n mixed ones, of the near surface and of the far one.

    The near one's disparities are above the middle of three bounds (3, n) and not above the last, the far
    one's not above the middle and not below the first. A pixel counts by its distance.
    """
    near, far = _Sums.none(len(row)), _Sums.none(len(row))
    colours, depths, counts = picture.reshape(-1, picture.shape[2]), disparity.ravel(), among.ravel()
    for first in range(0, len(row), CHUNK):
        checkpoint(0.3)
        some = slice(first, first + CHUNK)
        (low, middle, high), sums = bounds[:, some], (near.part(some), far.part(some))
        for dy in range(-radius, radius + 1):
            for dx in range(-radius, radius + 1):
                at = _neighbours(row[some], column[some], dy, dx, disparity.shape)
                depth, colour = depths[at], colours[at].T[:3].astype(np.float64)
                weight = counts[at] / (1.0 + dy**2 + dx**2)
                squared = (colour**2).sum(axis=0)
                sides = (depth > middle) & (depth <= high), (depth <= middle) & (depth >= low)
                for side, total in zip(sides, sums, strict=True):
                    total.add(weight * side, colour, squared, depth)
    return near, far
