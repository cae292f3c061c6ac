"""Semiglobal matching of whole-numbered costs, and the level that wins.

Hirschmueller, "Stereo processing by semiglobal matching and mutual information", 2008.
"""

import itertools

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Indices, Map
from ..base.limits import threads
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side

Costs = NDArray[np.uint16]
"""(h, k, w) costs of the k levels of each pixel, in steps of 1 / `STEPS` grey levels."""
STEPS = 512
"""Steps of a grey level: sums of four paths stay below 2^16 where costs and `p2` together stay below 32 grey
levels. NumPy does 16-bit integers in half of the time of 32-bit floats."""
NARROWEST = 128
"""Columns that a thread sums costs along, at least: with 160 of them it takes 1.9 times the processor time
that they take with all 640, by a scratch script."""
CHECKED = 4
"""Rows of costs between two checkpoints: 5 ms at 960x540 pixels and 64 levels, on an idle machine."""
P1 = 0.6
"""Grey levels: cost of a change of depth by one level."""
P2 = 10.0
"""Grey levels: cost of a larger change where the picture has no edge."""
P2_HALVED_AT = 8.0
"""Grey levels between neighbouring pixels at which a larger change of depth costs half."""


def semiglobal(costs: Costs, guide: Map) -> Costs:
    """Sum costs (h, k, w) along the rows and columns of a picture (h, w) in grey levels, both ways."""
    height, count, width = costs.shape
    upright = np.empty((width, count, height), np.uint16)
    down, across = np.empty_like(costs), np.empty_like(upright)
    ways = [
        (part[..., columns], light[:, columns], total[..., columns])
        for part, light, total in ((costs, guide, down), (upright, guide.T, across))
        for columns in _blocks(light.shape[1])
    ]
    # OpenCV does one level at a time faster than numpy all, and in all threads.
    planes = zip(costs.swapaxes(0, 1), upright.swapaxes(0, 1), strict=True)
    side_by_side(lambda both: _transpose(*both), planes)
    side_by_side(lambda way: _both_ways(*way), ways)
    planes = zip(down.swapaxes(0, 1), across.swapaxes(0, 1), strict=True)
    side_by_side(lambda both: _add_transposed(*both), planes)
    return down


def _blocks(width: int) -> list[slice]:
    """Columns of so many, for half of the threads each: the others do the rows meanwhile."""
    count = max(1, min(-(-threads() // 2), width // NARROWEST))
    edges = [width * n // count for n in range(count + 1)]
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


def _transpose(plane: Costs, into: Costs) -> None:
    """Write a plane (h, w) into another (w, h)."""
    checkpoint()
    cv2.transpose(plane, into)


def _add_transposed(plane: Costs, other: Costs) -> None:
    """Add to a plane (h, w) another (w, h)."""
    checkpoint()
    cv2.add(plane, cv2.transpose(other), dst=plane)


def _both_ways(costs: Costs, guide: Map, total: Costs) -> None:
    """Add costs (h, k, w), summed along the columns of a grey picture (h, w) both ways, to `total`."""
    p1 = np.uint16(np.rint(STEPS * P1))
    p2 = P2 / (1 + np.abs(np.diff(guide, axis=0)) / P2_HALVED_AT)
    p2 = np.rint(STEPS * np.maximum(p2, 1.1 * P1)).astype(np.uint16)
    last = len(costs) - 1
    beside = np.empty_like(costs[0])
    for rows in (range(last + 1), range(last, -1, -1)):
        path = np.zeros_like(costs[0])
        best = np.empty_like(path)
        before = rows[0]
        for row in rows:
            if row % CHECKED == 0:
                checkpoint()
            lowest = path.min(axis=0)
            np.minimum(path, lowest + p2[min(row, before, last - 1)], out=best)
            np.add(path, p1, out=beside)
            np.minimum(best[1:], beside[:-1], out=best[1:])
            np.minimum(best[:-1], beside[1:], out=best[:-1])
            best -= lowest
            best += costs[row]
            if rows.step > 0:
                # Nothing is in it yet.
                total[row] = best
            else:
                total[row] += best
            path, best, before = best, path, row


def lowest(costs: Costs) -> Indices:
    """Return (h, w) level of the least of costs (h, k, w), the first of those that are alike."""
    level = np.arange(costs.shape[1], dtype=np.uint32)[:, None]
    best = np.empty((costs.shape[0], costs.shape[2]), np.intp)
    # NumPy's own search goes along other axes than the last one value after the other: four times as long.
    for row, into in zip(costs, best, strict=True):
        packed = row.astype(np.uint32)
        packed <<= 16
        packed |= level
        into[:] = packed.min(axis=0) & 0xFFFF
    return best


def best_levels(costs: Costs) -> tuple[Indices, Map]:
    """Return the best level (h, w) of costs (h, k, w), without the first and last, and its fraction.

    The minimum of sums of differences is a corner where two lines of opposite slopes meet (Shimizu and
    Okutomi, "Precise sub-pixel estimation on area-based matching", 2001).
    """
    best = np.clip(lowest(costs), 1, costs.shape[1] - 2)
    before, at, after = (
        np.take_along_axis(costs, (best + k)[:, None], axis=1)[:, 0].astype(np.float32) for k in (-1, 0, 1)
    )
    rise = np.maximum(before, after) - at
    step = np.divide(before - after, 2 * rise, out=np.zeros_like(rise), where=rise > 1e-6)
    return best, (best + np.clip(step, -1, 1)).astype(np.float32)
