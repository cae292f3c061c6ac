"""Triangles over a raster of depths: coarse where depth is smooth, a pixel fine along its jumps.

Vertices lie at pixel centres, so that a piece of surface ends where its last pixel is and takes no colour
from beyond. Where depth jumps no triangle spans the gap.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .reconstruction import Floats, Ints

Mask = NDArray[np.bool_]

COARSEST = 6
"""Levels: a cell is at most 2 ** 6 pixels wide."""


def triangulate(depth: Floats, inside: Mask, jump: float, error: float) -> Ints:
    """Triangles (T, 3), three rows of the raveled raster each, interpolating `depth` (H, W) within `error`.

    Only pixels `inside` (H, W) are connected, and no two neighbours (diagonal ones too) whose depths are more
    than `jump` apart. A restricted quadtree: neighbouring cells differ by at most one level, and a cell's
    triangles fan out to the middle of every side that has finer ones beyond, so there are no cracks.
    Herzen and Barr, "Accurate triangulations of deformed, intersecting surfaces", 1987.
    """
    height, width = depth.shape
    rows, columns = (-(-(n - 1) >> COARSEST) << COARSEST for n in (height, width))
    # Cells reach past the border, where surfaces go straight on; what lies beyond is moved back onto it.
    beyond = ((0, rows + 1 - height), (0, columns + 1 - width))
    padded = (
        np.pad(depth, beyond, mode="reflect", reflect_type="odd")
        if min(height, width) > 1
        else np.zeros((rows + 1, columns + 1))
    )
    solid = np.pad(inside, beyond, mode="edge")
    whole = _whole(padded, solid, jump)
    split = _split(padded, whole, error)
    parts = []
    leaf = np.ones((rows >> COARSEST, columns >> COARSEST), bool)
    for level in range(COARSEST, -1, -1):
        if level:
            parts.append(_cells(leaf & ~split[level], split[level], level, padded.shape[1]))
            leaf = _children(leaf & split[level])
        else:
            parts.append(_finest(leaf, padded, solid, whole, jump))
    triangles = np.concatenate(parts)
    row, column = np.divmod(triangles, padded.shape[1])
    moved = np.minimum(row, height - 1) * width + np.minimum(column, width - 1)
    row, column = np.divmod(moved, width)
    area = (column[:, 1] - column[:, 0]) * (row[:, 2] - row[:, 0])
    area -= (column[:, 2] - column[:, 0]) * (row[:, 1] - row[:, 0])
    return np.asarray(moved[area != 0], np.int32)


def _whole(depth: Floats, solid: Mask, jump: float) -> Mask:
    """(H - 1, W - 1) cells of four connected pixels."""
    corners = [(slice(i, i - 1 or None), slice(j, j - 1 or None)) for i in (0, 1) for j in (0, 1)]
    values = np.stack([depth[c] for c in corners])
    there = np.all([solid[c] for c in corners], axis=0)
    return np.asarray(there & (np.ptp(values, axis=0) <= jump))


def _split(depth: Floats, whole: Mask, error: float) -> list[Mask]:
    """For each level the cells (R, C) that need finer ones."""
    split = [np.zeros_like(whole)]
    fine = whole
    for level in range(1, COARSEST + 1):
        fine = fine[::2, ::2] & fine[1::2, ::2] & fine[::2, 1::2] & fine[1::2, 1::2]
        near = split[-1]
        # A cell beside one that is split twice would differ from its neighbours by two levels.
        wide = np.pad(near, 1)
        wide = wide[:-2] | wide[1:-1] | wide[2:]
        wide = wide[:, :-2] | wide[:, 1:-1] | wide[:, 2:]
        needed = wide[::2, ::2] | wide[1::2, ::2] | wide[::2, 1::2] | wide[1::2, 1::2]
        needed |= ~fine
        rough = np.nonzero(~needed)
        needed[rough] = _worst(depth, rough, level) > error
        split.append(needed)
    return split


def _worst(depth: Floats, cells: tuple[NDArray[np.intp], ...], level: int) -> Floats:
    """(n,) by how much a cell's two triangles, or any fan of its sides' middles, miss the depths within."""
    size = 1 << level
    share = np.arange(size + 1) / size
    y, x = share[:, None], share
    worst = np.empty(len(cells[0]))
    chunk = max(1, 4_000_000 // (size + 1) ** 2)
    for first in range(0, len(worst), chunk):
        row, column = (part[first : first + chunk, None, None] * size for part in cells)
        inner = depth[row + np.arange(size + 1)[:, None], column + np.arange(size + 1)]
        a, b, c, d = (inner[:, i, j][:, None, None] for i, j in ((0, 0), (0, -1), (-1, 0), (-1, -1)))
        # The diagonal goes from b to c, as in `_cells`.
        plane = np.where(x + y <= 1, a + (b - a) * x + (c - a) * y, d + (c - d) * (1 - x) + (b - d) * (1 - y))
        worst[first : first + chunk] = np.abs(inner - plane).max(axis=(1, 2))
    return worst


def _children(leaf: Mask) -> Mask:
    return np.repeat(np.repeat(leaf, 2, axis=0), 2, axis=1)


def _cells(leaf: Mask, split: Mask, level: int, width: int) -> Ints:
    """Triangles (T, 3) of the leaves (R, C) of a level; the middles of sides with finer cells take part."""
    wide = np.pad(split, 1)
    sides = wide[:-2, 1:-1], wide[1:-1, 2:], wide[2:, 1:-1], wide[1:-1, :-2]
    pattern = sum(side.astype(np.int64) << n for n, side in enumerate(sides))
    half = 1 << (level - 1)
    parts = [np.zeros((0, 3), np.int64)]
    for kind in range(16):
        row, column = np.nonzero(leaf & (pattern == kind))
        fan = _fan(kind) * half
        first = ((row * width + column) << level)[:, None, None]
        parts.append((first + fan[..., 0] * width + fan[..., 1]).reshape(-1, 3))
    return np.concatenate(parts)


def _fan(kind: int) -> NDArray[np.int64]:
    """(t, 3, 2) rows and columns of a cell's triangles, in half cells; bit n of `kind` refines side n."""
    if not kind:
        return np.array([[(0, 0), (0, 2), (2, 0)], [(0, 2), (2, 2), (2, 0)]])
    corners, middles = ((0, 0), (0, 2), (2, 2), (2, 0)), ((0, 1), (1, 2), (2, 1), (1, 0))
    rim = [place for n in range(4) for place in (corners[n], *([middles[n]] if kind >> n & 1 else []))]
    return np.array([[(1, 1), rim[n - 1], rim[n]] for n in range(len(rim))])


def _finest(leaf: Mask, depth: Floats, solid: Mask, whole: Mask, jump: float) -> Ints:
    """Triangles of cells a pixel wide; of those with a gap the ones of three connected pixels."""
    width = depth.shape[1]
    row, column = np.nonzero(leaf)
    corner = (row * width + column)[:, None] + [0, 1, width, width + 1]
    z, there = depth.ravel()[corner], solid.ravel()[corner]

    def held(*rows: int) -> Mask:
        some = z[:, rows]
        return np.asarray(there[:, rows].all(axis=1) & (np.ptp(some, axis=1) <= jump))

    full = whole[row, column]
    upper, lower, left, right = held(0, 1, 2), held(1, 2, 3), held(0, 1, 3), held(0, 2, 3)
    across = full | upper | lower
    chosen = (
        (upper | full, (0, 1, 2)),
        (lower | full, (1, 3, 2)),
        (left & ~across, (0, 1, 3)),
        (right & ~across, (0, 3, 2)),
    )
    return np.concatenate([corner[mask][:, rows] for mask, rows in chosen])
