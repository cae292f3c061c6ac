"""Plane sweep with known cameras: the inverse depth at which a frame's neighbours agree with it."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.progress import checkpoint, in_this_scope
from ..camera.reconstruction import Floats

Map = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]

TRUNCATED = 8.0
"""Grey levels: a larger difference is another surface, and how much larger says nothing."""
NEAREST = 0.05
"""A plane whose depth shrinks below this share on the way to a neighbour is out of that neighbour's sight."""
RADIUS, FLATNESS = 2, 30.0
"""Of the guided filter that gathers costs: pixels, and the squared grey levels that count as one surface."""
SMALL_STEP, JUMP = 0.6, 10.0
"""Costs of a change of depth by one level, and of a jump where the picture has no edge."""
EDGE = 8.0
"""Grey levels of difference at which a jump costs half."""
FARTHER = 0.1
"""Grey levels by which the farthest is preferred to the nearest: what shows nothing is often sky."""
SAME_LIGHT = 0.01
"""Difference of exposure that is left alone."""
WORKERS = 2
"""Threads."""
CHECKED = 4
"""Rows of costs between two checkpoints: 5 ms at 960x540 pixels and 64 levels, on an idle machine."""


@dataclass(frozen=True)
class View:
    """A neighbour frame as the sweep sees it; places have OpenCV's pixel centres."""

    picture: Bytes
    """(h, w, 4) RGB, and 255 where its lens saw something."""
    turn: Floats
    """(3, 3) homography of the plane infinitely far, from the frame's pixels to the neighbour's."""
    move: Floats
    """(3, 3) what is added to it per inverse depth."""
    side: int
    """Neighbours of one side see past a silhouette together."""

    def homography(self, inverse: float) -> Floats:
        """(3, 3) of the plane at one inverse depth."""
        return np.asarray(self.turn + inverse * self.move)

    def sees_plane(self, inverse: float, width: int, height: int) -> bool:
        """Whether all of a plane facing the frame lies ahead of the neighbour too."""
        corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]])
        return bool((corners @ self.homography(inverse)[2]).min() > NEAREST)

    def warped(self, inverse: float, width: int, height: int) -> Bytes:
        """(height, width, 4) what it sees of a plane facing the frame."""
        matrix, flags = self.homography(inverse), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(self.picture, matrix, (width, height), flags=flags), np.uint8)

    def shrunk(self, times: int) -> View:
        """The same in pictures so many times smaller."""
        small = small_picture(self.picture, times)
        down = _scaling(small.shape[1] / self.picture.shape[1], small.shape[0] / self.picture.shape[0])
        back = np.linalg.inv(down)
        return replace(self, picture=small, turn=down @ self.turn @ back, move=down @ self.move @ back)

    def exposed_as(self, own: Bytes, inverse: float) -> View:
        """The same as bright as the frame (h, w, 4), in the median of what both see, were it all so far."""
        seen = self.warped(inverse, own.shape[1], own.shape[0])
        ratio = np.ones(1)
        here, there = (small_picture(picture, 8) for picture in (own, seen))
        both = (here[..., 3] == 255) & (there[..., 3] == 255)
        if both.any():
            light, other = (p[both][:, :3].mean(axis=1) + 1 for p in (here, there))
            ratio = light / other
        gain = float(np.median(ratio))
        if abs(gain - 1) < SAME_LIGHT:
            return self
        rgb = cv2.convertScaleAbs(self.picture[..., :3], alpha=gain)
        return replace(self, picture=np.dstack([rgb, self.picture[..., 3]]))


def small_picture(picture: Bytes, times: int) -> Bytes:
    """(h, w, 4) so many times smaller, at least one pixel."""
    size = (max(picture.shape[1] // times, 1), max(picture.shape[0] // times, 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _scaling(across: float, down: float) -> Floats:
    """(3, 3) places in a resized picture, both with OpenCV's pixel centres."""
    return np.array([[across, 0, (across - 1) / 2], [0, down, (down - 1) / 2], [0, 0, 1.0]])


def sweep(own: Bytes, views: Sequence[View], levels: Floats, guide: Map) -> Map:
    """(k, h, w) float32 mismatch in grey levels of a frame (h, w, 4) at inverse depths (k,).

    Means over the neighbours of each side, gathered by a guided filter, and the better side counts: a surface
    at a silhouette is hidden from one side only (Kang, Szeliski and Chai 2001; Hosni et al. 2013).
    """
    costs = np.empty((len(levels), *own.shape[:2]), np.float32)
    sides = [[view for view in views if view.side == side] for side in sorted({v.side for v in views})]

    @in_this_scope
    def fill(first: int) -> None:
        filtering = cv2.ximgproc.createGuidedFilter(guide, RADIUS, FLATNESS)
        for k in range(first, len(levels), WORKERS):
            checkpoint(k / len(levels))
            parts = [_mean_mismatch(own, side, levels[k]) for side in sides]
            costs[k] = np.minimum.reduce([filtering.filter(cost) for cost, _ in parts])
            costs[k][~np.logical_or.reduce([seen for _, seen in parts])] = np.inf

    with ThreadPoolExecutor(WORKERS) as pool:
        list(pool.map(fill, range(WORKERS)))
    costs += np.linspace(0, FARTHER, len(levels), dtype=np.float32)[:, None, None]
    # A depth at which no neighbour sees the place has nothing for it, and nothing against it.
    best = costs.min(axis=0)
    np.copyto(costs, np.where(np.isfinite(best), best, 0), where=np.isinf(costs))
    return costs


def _mean_mismatch(own: Bytes, views: Sequence[View], inverse: float) -> tuple[Map, Mask]:
    """(h, w) over those of the neighbours that see a place, and whether one sees all around."""
    height, width = own.shape[:2]
    mean = np.array([[1, 1, 1, 0]], np.float32) / 3
    total = np.full((height, width), 1e-3 * TRUNCATED, np.float32)
    count = np.full((height, width), 1e-3, np.float32)
    for view in views:
        if not view.sees_plane(inverse, width, height):
            continue
        seen = view.warped(inverse, width, height)
        cost = cv2.min(cv2.transform(cv2.absdiff(own, seen), mean), TRUNCATED)  # type: ignore[call-overload]
        valid = cv2.compare(cv2.extractChannel(seen, 3), 254, cv2.CMP_GE)  # type: ignore[call-overload]
        cv2.accumulate(cost, total, mask=valid)
        cv2.add(count, 1.0, dst=count, mask=valid)  # type: ignore[call-overload]
    seen_by_one = cv2.erode((count > 0.5).astype(np.uint8), np.ones((4 * RADIUS + 1,) * 2), borderValue=1)
    return np.asarray(total / count, np.float32), seen_by_one > 0


def semiglobal(costs: Map, guide: Map) -> Map:
    """(k, h, w) costs summed along the rows and columns of the picture in both directions.

    Hirschmueller, "Stereo processing by semiglobal matching and mutual information", 2008.
    """
    upright = np.empty((len(costs), *guide.T.shape), np.float32)
    with ThreadPoolExecutor(WORKERS) as pool:
        # OpenCV does one level at a time faster than numpy all, and in both threads.
        list(pool.map(in_this_scope(_transpose), costs, upright))
        down, across = pool.map(in_this_scope(_both_ways), (costs, upright), (guide, guide.T))
        list(pool.map(in_this_scope(_add_transposed), down, across))
    return down


def _transpose(plane: Map, into: Map) -> None:
    checkpoint()
    cv2.transpose(plane, into)


def _add_transposed(plane: Map, other: Map) -> None:
    checkpoint()
    cv2.add(plane, cv2.transpose(other), dst=plane)


def _both_ways(costs: Map, guide: Map) -> Map:
    """Costs (k, h, w) summed along the columns of a grey picture (h, w), downwards and upwards."""
    jump = np.maximum(JUMP / (1 + np.abs(np.diff(guide, axis=0)) / EDGE), 1.1 * SMALL_STEP).astype(np.float32)
    total = np.empty_like(costs)
    last = costs.shape[1] - 1
    for rows in (range(last + 1), range(last, -1, -1)):
        path = np.zeros_like(costs[:, 0])
        before = rows[0]
        for row in rows:
            if row % CHECKED == 0:
                checkpoint()
            lowest = path.min(axis=0)
            best = np.minimum(path, lowest + jump[min(row, before, last - 1)])
            np.minimum(best[1:], path[:-1] + np.float32(SMALL_STEP), out=best[1:])
            np.minimum(best[:-1], path[1:] + np.float32(SMALL_STEP), out=best[:-1])
            best -= lowest
            best += costs[:, row]
            if rows.step > 0:
                # Nothing is in it yet.
                total[:, row] = best
            else:
                total[:, row] += best
            path, before = best, row
    return total


def lowest(costs: Map) -> tuple[NDArray[np.intp], Map]:
    """(h, w) best level of costs (k, h, w), and the same with its fraction.

    Of costs that are sums of differences the minimum is a corner: two lines of opposite slopes meet there
    (Shimizu and Okutomi, "Precise sub-pixel estimation on area-based matching", 2001).
    """
    best = np.clip(costs.argmin(axis=0), 1, len(costs) - 2)
    before, at, after = (np.take_along_axis(costs, (best + k)[None], axis=0)[0] for k in (-1, 0, 1))
    rise = np.maximum(before, after) - at
    step = np.divide(before - after, 2 * rise, out=np.zeros_like(rise), where=rise > 1e-6)
    return best, (best + np.clip(step, -1, 1)).astype(np.float32)
