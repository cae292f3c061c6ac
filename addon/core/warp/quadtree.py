"""Quadtree triangulation of two surfaces on a raster: coarse where both are smooth, up to single pixels.

Vertices are pixel centres. A cell across a silhouette can be coarse if both surfaces are smooth: both are
drawn over all of it, and the near one's picture is transparent past the silhouette. Where three surfaces
meet, cells of a pixel are cut between them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Indices, Ints, Map, Mask, repeated
from ..base.progress import checkpoint

CHUNK = 1 << 17
"""Pixels of cells processed at once, to fit a processor's cache."""
COARSEST = 6
"""Largest cell in powers of 2 pixels. Chosen by inspection."""
COARSEST_AT_SILHOUETTES = 4
"""Largest cell with a silhouette, in powers of 2 pixels: the reach of extrapolated surfaces."""
SILHOUETTE_ERROR = 6
"""Factor to the allowed error at depth jumps. With it bars take 4.9 instead of 7.1 % of the grid's triangles
from the video alone, foreground 8.1 instead of 13.2, both without loss."""
DISOCCLUDED_ERROR = 24
"""Factor to the allowed error of extrapolated depth. Chosen by inspection."""
BEND = 0.5
"""Least bent share of a change of depth that is a small jump. Chosen by inspection."""


@dataclass(frozen=True)
class Surfaces:
    """Two surfaces on a raster, with depths in any common unit."""

    own: Map
    """(H, W) depth of the visible surface; mixed pixels have the near one's."""
    near: Map
    """(H, W) depth of the near surface, extrapolated past silhouettes; elsewhere `own`."""
    far: Map
    """(H, W) depth of the far surface, extrapolated behind the near one; elsewhere `own`."""
    mixed: Mask
    """(H, W) mixed pixels at silhouettes."""
    is_far: Mask
    """(H, W) pixels in which the near surface is extrapolated and invisible."""
    disoccluded: Mask
    """(H, W) pixels in which the far surface is extrapolated and may be visible."""


@dataclass(frozen=True)
class Triangles:
    """Triangles of two surfaces, as pixel indices in the raveled raster."""

    far: Ints
    """(T, 3) of the far surface, which is complete and connected."""
    near: Ints
    """(T, 3) of the near surface."""
    cut: Ints
    """(T, 3) of the visible surface where more than two meet."""
    before: Mask
    """(H, W) pixels covered by the near surface's triangles, rim included."""


def triangulate(surfaces: Surfaces, jump: float, error: float | Map) -> Triangles:
    """Triangulate surfaces within `error`, one for all or each pixel (H, W), in their unit.

    Neighbours, also diagonal ones, whose depths differ by more than `jump` are not connected. In a restricted
    quadtree neighbouring cells differ by at most one level, and a cell's triangles fan out to the middle of
    each side with finer neighbours, so there are no cracks. Herzen and Barr, "Accurate triangulations of
    deformed, intersecting surfaces", 1987.
    """
    height, width = surfaces.own.shape
    raster = _padded(surfaces)
    columns = raster.own.shape[1]
    checkpoint(0.6)
    whole = ~_any(raster.mixed) & (_range(raster.own) <= jump)
    checkpoint(0.6)
    split = _split(raster, whole, _allowed(error, (height, width), whole.shape))
    checkpoint(0.6)
    two = _any(raster.mixed | ((raster.near != raster.far) & ~raster.is_far))
    two_surfaces = [two]
    for _ in range(COARSEST):
        two_surfaces.append(_halved(two_surfaces[-1], np.logical_or))
    far, near = [], []
    covered = np.zeros_like(whole)
    leaf = np.ones(tuple(n >> COARSEST for n in whole.shape), bool)
    for level in range(COARSEST, 0, -1):
        checkpoint(0.6)
        ends = leaf & ~split[level]
        before = ends & two_surfaces[level]
        far.append(_cells(ends, split[level], level, columns))
        near.append(_cells(before, split[level], level, columns))
        covered |= _children(before, level)
        leaf = _children(leaf & split[level])
    far.append(_squares(leaf, columns))
    near.append(_squares(leaf & whole & two, columns))
    covered |= leaf & whole & two
    checkpoint(0.6)
    parts = np.concatenate(far), np.concatenate(near), _held(leaf & ~whole, raster.own, jump)
    rim = np.pad(covered, 1)
    around = rim[1:, 1:] | rim[:-1, 1:] | rim[1:, :-1] | rim[:-1, :-1]
    made = [_back(part, columns, height, width) for part in parts]
    return Triangles(made[0], made[1], made[2], around[:height, :width])


def _padded(surfaces: Surfaces) -> Surfaces:
    """Extrapolate surfaces linearly to sides that are multiples of the coarsest cell's, plus one."""
    height, width = surfaces.own.shape
    rows, columns = (-(-(n - 1) >> COARSEST) << COARSEST for n in (height, width))
    beyond = ((0, rows + 1 - height), (0, columns + 1 - width))

    def depth(values: Map) -> Map:
        if min(height, width) == 1:
            return np.zeros((rows + 1, columns + 1), np.float32)
        return np.pad(values, beyond, mode="reflect", reflect_type="odd")

    masks = (np.pad(mask, beyond) for mask in (surfaces.mixed, surfaces.is_far, surfaces.disoccluded))
    return Surfaces(depth(surfaces.own), depth(surfaces.near), depth(surfaces.far), *masks)


def _back(triangles: Ints, padded: int, height: int, width: int) -> Ints:
    """Move triangles from a raster `padded` pixels wide back to one of (height, width)."""
    row, column = np.divmod(triangles, padded)
    row, column = np.minimum(row, height - 1), np.minimum(column, width - 1)
    area = (column[:, 1] - column[:, 0]) * (row[:, 2] - row[:, 0])
    area -= (column[:, 2] - column[:, 0]) * (row[:, 1] - row[:, 0])
    return np.asarray((row * width + column)[area != 0], np.int32)


def _of_corners[T: np.generic](values: NDArray[T], combine: np.ufunc) -> NDArray[T]:
    """Combine values (H, W) at the corners of cells a pixel wide, as (H - 1, W - 1)."""
    rows = combine(values[:-1], values[1:])
    return np.asarray(combine(rows[:, :-1], rows[:, 1:]))


def _halved[T: np.generic](cells: NDArray[T], combine: np.ufunc) -> NDArray[T]:
    """Combine values of finer cells (2 R, 2 C) to (R, C)."""
    rows = combine(cells[::2], cells[1::2])
    return np.asarray(combine(rows[:, ::2], rows[:, 1::2]))


def _range(depth: Map) -> Map:
    """Return (H - 1, W - 1) changes of depth (H, W) over cells a pixel wide."""
    return _of_corners(depth, np.maximum) - _of_corners(depth, np.minimum)


def _bent(depth: Map) -> Map:
    """Return (H - 1, W - 1) second differences of depth (H, W) at the corners of cells."""
    across = np.abs(np.diff(depth, 2, axis=1, prepend=depth[:, :1], append=depth[:, -1:]))
    down = np.abs(np.diff(depth, 2, axis=0, prepend=depth[:1], append=depth[-1:]))
    return _of_corners(np.maximum(across, down), np.maximum)


def _any(mask: Mask) -> Mask:
    """Mark (H - 1, W - 1) cells with a corner in a mask (H, W)."""
    return _of_corners(mask, np.logical_or)


def _allowed(error: float | Map, shape: tuple[int, int], cells: tuple[int, ...]) -> Map:
    """Return (H - 1, W - 1) allowed errors of cells a pixel wide, repeated past the border (H, W)."""
    beyond = [(0, n + 1 - size) for n, size in zip(cells, shape, strict=True)]
    whole = np.pad(np.broadcast_to(np.asarray(error, np.float32), shape), beyond, mode="edge")
    return _of_corners(whole, np.minimum)


def _split(raster: Surfaces, whole: Mask, error: Map) -> list[Mask]:
    """Mark cells (R, C) of each level to be split, by connected pixels `whole` and allowed errors."""
    split = [np.zeros_like(whole)]
    doubled = _any((raster.near != raster.far) & ~raster.is_far)
    silhouette = ~whole
    checkpoint(0.6)
    low, high = (_of_corners(raster.own, combine) for combine in (np.minimum, np.maximum))
    changes = high - low
    checkpoint(0.6)
    steep = (changes > error) & (_bent(raster.own) > BEND * changes)
    of_near = (~raster.is_far).astype(np.float32) / np.float32(SILHOUETTE_ERROR)
    of_far = raster.disoccluded.astype(np.float32) / np.float32(DISOCCLUDED_ERROR)
    of_far[raster.is_far | raster.mixed] = 1 / SILHOUETTE_ERROR
    for level in range(1, COARSEST + 1):
        checkpoint(0.6)
        error, low, high = _halved(error, np.minimum), _halved(low, np.minimum), _halved(high, np.maximum)
        silhouette, doubled, steep = (_halved(one, np.logical_or) for one in (silhouette, doubled, steep))
        near = split[-1]
        # A cell beside one that is split twice would differ from its neighbours by two levels.
        wide = np.pad(near, 1)
        wide = wide[:-2] | wide[1:-1] | wide[2:]
        wide = wide[:, :-2] | wide[:, 1:-1] | wide[:, 2:]
        needed = _halved(wide, np.logical_or)
        one = ~silhouette & ~doubled
        if level > COARSEST_AT_SILHOUETTES:
            needed |= silhouette
        # The error between corners is at most the whole range.
        rough = np.nonzero(one & ~needed & (high - low > error))
        allowed = np.where(steep, SILHOUETTE_ERROR, 1)[rough] * error[rough]
        needed[rough] = _worst(raster.own, None, rough, level) > allowed
        checkpoint(0.6)
        rough = np.nonzero(~one & ~needed)
        worst = np.maximum(
            _worst(raster.near, of_near, rough, level), _worst(raster.far, of_far, rough, level)
        )
        needed[rough] = worst > error[rough]
        split.append(needed)
    return split


def _worst(depth: Map, weight: Map | None, cells: tuple[Indices, ...], level: int) -> Map:
    """Return (n,) largest errors of depth, by weight (H, W), in cells of two triangles or any fan."""
    if not len(cells[0]):
        return np.zeros(0, np.float32)
    size = 1 << level
    share = np.arange(size + 1) / size
    x, y = (part.ravel() for part in np.meshgrid(share, share))
    # The diagonal runs from b to c, as in `_cells`.
    upper = np.stack([1 - x - y, x, y, 0 * x])
    lower = np.stack([0 * x, 1 - y, 1 - x, x + y - 1])
    plane = np.where(x + y <= 1, upper, lower).astype(np.float32)
    blocks, weights = _blocks(depth, size), None if weight is None else _blocks(weight, size)
    worst = np.empty(len(cells[0]), np.float32)
    chunk = max(1, CHUNK // (size + 1) ** 2)
    for first in range(0, len(worst), chunk):
        checkpoint(0.6)
        some = cells[0][first : first + chunk], cells[1][first : first + chunk]
        inner = blocks[some].reshape(-1, len(x))
        miss = inner[:, [0, size, -1 - size, -1]] @ plane
        np.abs(np.subtract(inner, miss, out=miss), out=miss)
        if weights is not None:
            miss *= weights[some].reshape(-1, len(x))
        worst[first : first + chunk] = miss.max(axis=1)
    return worst


def _blocks[T: np.generic](raster: NDArray[T], size: int) -> NDArray[T]:
    """Return (R, C, size + 1, size + 1) pixels of each cell of a raster (H, W), with shared rims."""
    return np.lib.stride_tricks.sliding_window_view(raster, (size + 1, size + 1))[::size, ::size]


def _children(cells: Mask, levels: int = 1) -> Mask:
    """Refine a mask of cells (R, C) by `levels`."""
    return repeated(cells, 1 << levels)


def _cells(leaf: Mask, split: Mask, level: int, width: int) -> Ints:
    """Make triangles (T, 3) of a level's leaves (R, C), with the middles of sides that have finer cells."""
    wide = np.pad(split, 1)
    sides = wide[:-2, 1:-1], wide[1:-1, 2:], wide[2:, 1:-1], wide[1:-1, :-2]
    pattern = np.sum([side.astype(np.int64) << n for n, side in enumerate(sides)], axis=0)
    half = 1 << (level - 1)
    rows, columns = np.nonzero(leaf)
    kinds, first = pattern[rows, columns], (rows * width + columns) << level
    parts = [np.zeros((0, 3), np.int64)]
    for kind in np.flatnonzero(np.bincount(kinds)):
        fan = _fan(int(kind)) * half
        corner = first[kinds == kind][:, None, None]
        parts.append((corner + fan[..., 0] * width + fan[..., 1]).reshape(-1, 3))
    return np.concatenate(parts)


def _fan(kind: int) -> NDArray[np.int64]:
    """Return (t, 3, 2) triangles of a cell in half cells (row, column); bit n of `kind` refines side n."""
    if not kind:
        return np.array([[(0, 0), (0, 2), (2, 0)], [(0, 2), (2, 2), (2, 0)]])
    corners, middles = ((0, 0), (0, 2), (2, 2), (2, 0)), ((0, 1), (1, 2), (2, 1), (1, 0))
    rim = [place for n in range(4) for place in (corners[n], *([middles[n]] if kind >> n & 1 else []))]
    return np.array([[(1, 1), rim[n - 1], rim[n]] for n in range(len(rim))])


def _squares(leaf: Mask, width: int) -> Ints:
    """Make two triangles (T, 3) for each cell (H - 1, W - 1) a pixel wide."""
    row, column = np.nonzero(leaf)
    corner = (row * width + column)[:, None]
    return np.concatenate([corner + rows for rows in ([0, 1, width], [1, width + 1, width])])


def _held(leaf: Mask, depth: Map, jump: float) -> Ints:
    """Make triangles (T, 3) of three or four connected pixels in cells (H - 1, W - 1) a pixel wide."""
    width = depth.shape[1]
    row, column = np.nonzero(leaf)
    corner = (row * width + column)[:, None] + [0, 1, width, width + 1]
    z = depth.ravel()[corner]

    def held(*rows: int) -> Mask:
        return np.asarray(np.ptp(z[:, rows], axis=1) <= jump)

    full, upper, lower = held(0, 1, 2, 3), held(0, 1, 2), held(1, 2, 3)
    left, right = held(0, 1, 3), held(0, 2, 3)
    across = full | upper | lower
    chosen = (
        (upper | full, (0, 1, 2)),
        (lower | full, (1, 3, 2)),
        (left & ~across, (0, 1, 3)),
        (right & ~across, (0, 3, 2)),
    )
    return np.concatenate([corner[mask][:, rows] for mask, rows in chosen])
