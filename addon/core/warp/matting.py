"""Mixed pixels: how much of each the nearer one of the two surfaces covers that meet at a silhouette."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, LinearRGBA, Map, Mask
from ..base.progress import checkpoint


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
    picture: LinearRGBA, disparity: Floats, mixed: Mask, jump: float, options: MattingOptions
) -> Surfaces:
    """The surfaces beside the mixed pixels (H, W) of a picture (H, W, 4) with disparities (H, W)."""
    row, column = np.nonzero(mixed)
    offset = np.arange(-options.search_radius, options.search_radius + 1)
    dy, dx = (part.ravel() for part in np.meshgrid(offset, offset, indexing="ij"))
    y = np.clip(row[:, None] + dy, 0, disparity.shape[0] - 1)
    x = np.clip(column[:, None] + dx, 0, disparity.shape[1] - 1)
    around, pure = disparity[y, x], ~mixed[y, x]
    closest = (np.maximum(np.abs(dy), np.abs(dx)) <= 1) & np.ones_like(pure)
    high = np.max(around, axis=1, where=closest, initial=-np.inf)
    low = np.min(around, axis=1, where=closest, initial=np.inf)
    own = disparity[row, column]
    middle = (high + low) / 2
    weight = 1.0 / (1.0 + dy**2 + dx**2)
    checkpoint(0.3)
    colours = picture[y, x, :3]
    checkpoint(0.3)
    is_near, is_far = around > middle[:, None], around <= middle[:, None]
    # What is nearer or farther still belongs to a third surface.
    is_near &= around <= high[:, None] + jump
    is_far &= around >= low[:, None] - jump
    checkpoint(0.3)
    near, near_disparity, near_variance = _weighted_mean(
        colours, around, weight * (is_near & pure), weight * is_near, high
    )
    checkpoint(0.3)
    far, far_disparity, far_variance = _weighted_mean(
        colours, around, weight * (is_far & pure), weight * is_far, low
    )
    checkpoint(0.3)
    thin = ~(is_near & pure).any(axis=1)
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
    disparity: Floats,
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


def _weighted_mean(
    colours: LinearRGB, disparities: Floats, pure: Floats, any_: Floats, otherwise: Floats
) -> tuple[Floats, Floats, Floats]:
    """(n, 3) and (n,) means of colours (n, k, 3) and disparities (n, k), and (n,) the colours' variance.

    Weights (n, k) are those of pure pixels, if there are any, else those of any; without any the disparity is
    `otherwise` (n,).
    """
    weight = np.where(pure.any(axis=1)[:, None], pure, any_)
    total = weight.sum(axis=1)
    safe = np.maximum(total, 1e-12)[:, None]
    colour = np.einsum("nk,nkc->nc", weight, colours) / safe
    variance = np.einsum("nk,nkc->n", weight, colours**2) / safe[:, 0] - (colour**2).sum(axis=1)
    disparity = np.where(total > 0, np.einsum("nk,nk->n", weight, disparities) / safe[:, 0], otherwise)
    return colour, disparity, np.maximum(variance, 0)
