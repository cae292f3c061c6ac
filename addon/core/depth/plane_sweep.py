"""Plane sweep with known cameras: the inverse depth at which a frame's neighbours agree with it.

Collins, "A space-sweep approach to true multi-image matching", 1996; regularised by semiglobal matching.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Indices, Map, Mask
from ..base.limits import threads
from ..base.progress import checkpoint, in_this_scope

NARROWEST = 128
"""Columns that a thread sums costs along, at least: with 160 of them it takes 1.9 times the processor time
that they take with all 640, by a scratch script."""
CHECKED = 4
"""Rows of costs between two checkpoints: 5 ms at 960x540 pixels and 64 levels, on an idle machine."""


@dataclass(frozen=True)
class SweepOptions:
    """Matching cost and regularisation. Set by eye, then judged together on the scenes with true depth by
    `python -m benchmarks.accuracy.dense_depth`."""

    truncation: float = 8.0
    """Grey levels: differences are cut there, as a larger one is another surface. By eye."""
    least_depth_ratio: float = 0.05
    """A plane whose depth shrinks below this share on the way to a neighbour is left out for it. By eye."""
    guide_radius: int = 2
    """Pixels: radius of the guided filter that gathers costs. By eye."""
    guide_epsilon: float = 30.0
    """Squared grey levels that count as one surface in that guided filter. By eye."""
    p1: float = 0.6
    """Grey levels: semiglobal matching's cost of a change of depth by one level. By eye."""
    p2: float = 10.0
    """Grey levels: semiglobal matching's cost of a larger change where the picture has no edge. By eye."""
    p2_halved_at: float = 8.0
    """Grey levels between neighbouring pixels at which a larger change of depth costs half. By eye."""
    far_preference: float = 0.1
    """Grey levels by which the farthest is preferred to the nearest: what is plain is often sky. By eye."""
    least_gain: float = 0.01
    """Relative difference of exposure between frames that is left alone. By eye."""


@dataclass(frozen=True)
class View:
    """A neighbour frame as the sweep sees it; places have OpenCV's pixel centres.

    The homography of the plane at depth z that faces the frame is K' (R + t n^T / z) K^-1 (Hartley and
    Zisserman, "Multiple view geometry", 2004, eq. 13.2).
    """

    picture: Bytes
    """(h, w, 4) RGB as displayed, and 255 where its lens saw something that stands still."""
    infinite_homography: Floats
    """(3, 3) K' R K^-1: from the frame's pixels to the neighbour's, of the plane infinitely far."""
    parallax_term: Floats
    """(3, 3) K' t n^T K^-1: what each unit of inverse depth adds to the homography, towards the epipole."""
    side: int
    """-1 or 1: neighbours of one side see past a silhouette together."""

    def homography(self, inverse: float) -> Floats:
        """(3, 3) from the frame's pixels to the neighbour's, of the plane at one inverse depth."""
        return np.asarray(self.infinite_homography + inverse * self.parallax_term)

    def sees_plane(self, inverse: float, width: int, height: int, least_depth_ratio: float) -> bool:
        """Whether all of a plane facing the frame lies ahead of the neighbour too, as far as that ratio of
        its depths in both."""
        corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]])
        return bool((corners @ self.homography(inverse)[2]).min() > least_depth_ratio)

    def warped(self, inverse: float, width: int, height: int) -> Bytes:
        """(height, width, 4) what it sees of a plane facing the frame at one inverse depth."""
        matrix, flags = self.homography(inverse), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(self.picture, matrix, (width, height), flags=flags), np.uint8)

    def shrunk(self, times: int) -> View:
        """This view with a picture so many times smaller."""
        small = small_picture(self.picture, times)
        down = _scaling(small.shape[1] / self.picture.shape[1], small.shape[0] / self.picture.shape[0])
        up = np.linalg.inv(down)
        return replace(
            self, picture=small, infinite_homography=down @ self.infinite_homography @ up,
            parallax_term=down @ self.parallax_term @ up,
        )  # fmt: skip

    def exposed_as(self, reference: Bytes, inverse: float, least_gain: float) -> View:
        """This view made as bright as the frame (h, w, 4), in the median of what both see at one inverse
        depth; unchanged where it differs by less than `least_gain`."""
        seen = self.warped(inverse, reference.shape[1], reference.shape[0])
        ratio = np.ones(1)
        here, there = (small_picture(picture, 8) for picture in (reference, seen))
        both = (here[..., 3] == 255) & (there[..., 3] == 255)
        if both.any():
            light, other = (p[both][:, :3].mean(axis=1) + 1 for p in (here, there))
            ratio = light / other
        gain = float(np.median(ratio))
        if abs(gain - 1) < least_gain:
            return self
        rgb = cv2.convertScaleAbs(self.picture[..., :3], alpha=gain)
        return replace(self, picture=np.dstack([rgb, self.picture[..., 3]]))


def small_picture(picture: Bytes, times: int) -> Bytes:
    """A picture (h, w, 4) so many times smaller, at least one pixel, means over areas."""
    size = (max(picture.shape[1] // times, 1), max(picture.shape[0] // times, 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _scaling(across: float, down: float) -> Floats:
    """(3, 3) from pixels to those of a resized picture, both with OpenCV's pixel centres."""
    return np.array([[across, 0, (across - 1) / 2], [0, down, (down - 1) / 2], [0, 0, 1.0]])


def sweep(reference: Bytes, views: Sequence[View], levels: Floats, guide: Map, options: SweepOptions) -> Map:
    """(k, h, w) float32 mismatch in grey levels of a frame (h, w, 4) at inverse depths (k,); `guide` (h, w)
    is the frame in grey levels.

    Means over the neighbours of each side, gathered by a guided filter, and the better side counts: a surface
    at a silhouette is hidden from one side only (Kang, Szeliski and Chai, "Handling occlusions in dense
    multi-view stereo", 2001; Hosni et al., "Fast cost-volume filtering", 2013).
    """
    costs = np.empty((len(levels), *reference.shape[:2]), np.float32)
    sides = [[view for view in views if view.side == side] for side in sorted({v.side for v in views})]

    # What is found does not depend on their number.
    workers = threads()

    @in_this_scope
    def fill(first: int) -> None:
        filtering = cv2.ximgproc.createGuidedFilter(guide, options.guide_radius, options.guide_epsilon)
        for k in range(first, len(levels), workers):
            checkpoint(k / len(levels))
            parts = [_mean_mismatch(reference, side, levels[k], options) for side in sides]
            costs[k] = np.minimum.reduce([filtering.filter(cost) for cost, _ in parts])
            costs[k][~np.logical_or.reduce([seen for _, seen in parts])] = np.inf

    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(fill, range(workers)))
    costs += np.linspace(0, options.far_preference, len(levels), dtype=np.float32)[:, None, None]
    # A depth at which no neighbour sees the place has nothing for it, and nothing against it.
    best = costs.min(axis=0)
    np.copyto(costs, np.where(np.isfinite(best), best, 0), where=np.isinf(costs))
    return costs


def _mean_mismatch(
    reference: Bytes, views: Sequence[View], inverse: float, options: SweepOptions
) -> tuple[Map, Mask]:
    """(h, w) grey levels, mean over the neighbours that see a place, and whether one sees all around."""
    height, width = reference.shape[:2]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    total = np.full((height, width), 1e-3 * options.truncation, np.float32)
    count = np.full((height, width), 1e-3, np.float32)
    for view in views:
        if not view.sees_plane(inverse, width, height, options.least_depth_ratio):
            continue
        seen = view.warped(inverse, width, height)
        off = cv2.transform(cv2.absdiff(reference, seen), mean)
        cost = cv2.min(off, options.truncation)  # type: ignore[call-overload]
        valid = cv2.compare(cv2.extractChannel(seen, 3), 254, cv2.CMP_GE)  # type: ignore[call-overload]
        cv2.accumulate(cost, total, mask=valid)
        cv2.add(count, 1.0, dst=count, mask=valid)  # type: ignore[call-overload]
    # A guided filter averages twice over its radius.
    window = np.ones((4 * options.guide_radius + 1,) * 2)
    seen_by_one = cv2.erode((count > 0.5).astype(np.uint8), window, borderValue=1)
    return np.asarray(total / count, np.float32), seen_by_one > 0


def semiglobal(costs: Map, guide: Map, options: SweepOptions) -> Map:
    """(k, h, w) costs summed along the rows and columns of the picture, (h, w) grey levels, both ways.

    Hirschmueller, "Stereo processing by semiglobal matching and mutual information", 2008.
    """
    upright = np.empty((len(costs), *guide.T.shape), np.float32)
    down, across = np.empty_like(costs), np.empty_like(upright)
    ways = [
        (part[..., columns], light[:, columns], options, total[..., columns])
        for part, light, total in ((costs, guide, down), (upright, guide.T, across))
        for columns in _blocks(light.shape[1])
    ]
    with ThreadPoolExecutor(threads()) as pool:
        # OpenCV does one level at a time faster than numpy all, and in all threads.
        list(pool.map(in_this_scope(_transpose), costs, upright))
        list(pool.map(in_this_scope(_both_ways), *zip(*ways, strict=True)))
        list(pool.map(in_this_scope(_add_transposed), down, across))
    return down


def _blocks(width: int) -> list[slice]:
    """Columns of so many, for half of the threads each: the others do the rows meanwhile."""
    count = max(1, min(-(-threads() // 2), width // NARROWEST))
    edges = [width * n // count for n in range(count + 1)]
    return [slice(a, b) for a, b in itertools.pairwise(edges)]


def _transpose(plane: Map, into: Map) -> None:
    """Write a plane (h, w) into another (w, h)."""
    checkpoint()
    cv2.transpose(plane, into)


def _add_transposed(plane: Map, other: Map) -> None:
    """Add to a plane (h, w) another (w, h)."""
    checkpoint()
    cv2.add(plane, cv2.transpose(other), dst=plane)


def _both_ways(costs: Map, guide: Map, options: SweepOptions, total: Map) -> None:
    """Costs (k, h, w) summed along the columns of a grey picture (h, w), downwards and upwards, into `total`
    (k, h, w)."""
    p1 = np.float32(options.p1)
    p2 = options.p2 / (1 + np.abs(np.diff(guide, axis=0)) / options.p2_halved_at)
    p2 = np.maximum(p2, 1.1 * options.p1).astype(np.float32)
    last = costs.shape[1] - 1
    for rows in (range(last + 1), range(last, -1, -1)):
        path = np.zeros_like(costs[:, 0])
        before = rows[0]
        for row in rows:
            if row % CHECKED == 0:
                checkpoint()
            lowest = path.min(axis=0)
            best = np.minimum(path, lowest + p2[min(row, before, last - 1)])
            np.minimum(best[1:], path[:-1] + p1, out=best[1:])
            np.minimum(best[:-1], path[1:] + p1, out=best[:-1])
            best -= lowest
            best += costs[:, row]
            if rows.step > 0:
                # Nothing is in it yet.
                total[:, row] = best
            else:
                total[:, row] += best
            path, before = best, row


def best_levels(costs: Map) -> tuple[Indices, Map]:
    """(h, w) best level of costs (k, h, w), but for the first and the last, and the same with its fraction.

    Of costs that are sums of differences the minimum is a corner: two lines of opposite slopes meet there
    (Shimizu and Okutomi, "Precise sub-pixel estimation on area-based matching", 2001).
    """
    best = np.clip(costs.argmin(axis=0), 1, len(costs) - 2)
    before, at, after = (np.take_along_axis(costs, (best + k)[None], axis=0)[0] for k in (-1, 0, 1))
    rise = np.maximum(before, after) - at
    step = np.divide(before - after, 2 * rise, out=np.zeros_like(rise), where=rise > 1e-6)
    return best, (best + np.clip(step, -1, 1)).astype(np.float32)
