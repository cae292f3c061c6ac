"""Plane sweep with known cameras: the inverse depth at which a frame's neighbours agree with it.

Collins, "A space-sweep approach to true multi-image matching", 1996.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map
from ..base.limits import threads
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side
from .semiglobal import STEPS, Costs

UNSEEN = 65535
"""Cost of a level at which no neighbour sees the place, until all were looked at."""
TRUNCATION = 8
"""Grey levels: differences are cut there, as a larger one is another surface."""
LEAST_DEPTH_RATIO = 0.05
"""A plane whose depth shrinks below this share on the way to a neighbour is left out for it."""
GUIDE_RADIUS = 2
"""Pixels: radius of the guided filter that gathers costs."""
GUIDE_EPSILON = 30.0
"""Squared grey levels that count as one surface in that guided filter."""
FAR_PREFERENCE = 0.1
"""Grey levels by which the farthest level is preferred to the nearest: plain areas are often sky."""
FOOT = 255 * 0.055
"""Grey levels, which added to those of sRGB (IEC 61966-2-1) make them a power of light, but for the darkest:
light times a factor is levels times one."""
CLIPPED = 250
"""Grey level from which a pixel may be clipped. Chosen by inspection."""
LEAST_GAIN = 0.004
"""Relative difference of levels that is left alone: a step of 8 bits in white."""


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
    """(3, 3) K' t n^T K^-1: change of the homography for each unit of inverse depth, towards the epipole."""
    side: int
    """-1 or 1: neighbours of one side see past a silhouette together."""

    def homography(self, inverse: float) -> Floats:
        """Return (3, 3) from the frame's pixels to the neighbour's, of the plane at one inverse depth."""
        return np.asarray(self.infinite_homography + inverse * self.parallax_term)

    def sees_plane(self, inverse: float, width: int, height: int) -> bool:
        """Return whether a plane facing the frame lies ahead of the neighbour, too, in all of the picture."""
        corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]])
        return bool((corners @ self.homography(inverse)[2]).min() > LEAST_DEPTH_RATIO)

    def warped(self, inverse: float, width: int, height: int, into: Bytes | None = None) -> Bytes:
        """Return (height, width, 4) what it sees of a plane facing the frame at one inverse depth."""
        matrix, flags = self.homography(inverse), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(self.picture, matrix, (width, height), into, flags), np.uint8)

    def shrunk(self, times: int) -> View:
        """Return this view with a picture so many times smaller."""
        small = small_picture(self.picture, times)
        down = _scaling(small.shape[1] / self.picture.shape[1], small.shape[0] / self.picture.shape[0])
        up = np.linalg.inv(down)
        return replace(
            self, picture=small, infinite_homography=down @ self.infinite_homography @ up,
            parallax_term=down @ self.parallax_term @ up,
        )  # fmt: skip

    def exposed_as(self, reference: Bytes, inverse: float) -> View:
        """Return this view with the brightness of the frame (h, w, 4) in each channel.

        The factor is the median over the pixels that both see at one inverse depth.
        """
        seen = self.warped(inverse, reference.shape[1], reference.shape[0])
        here, there = (small_picture(picture, 8) for picture in (reference, seen))
        both = (here[..., 3] == 255) & (there[..., 3] == 255)
        rgb = exposed_as(self.picture[..., :3], here[both][:, :3], there[both][:, :3])
        return replace(self, picture=np.dstack([rgb, self.picture[..., 3]]))


def small_picture(picture: Bytes, times: int) -> Bytes:
    """Return a picture (h, w, 4) so many times smaller, at least one pixel, means over areas."""
    size = (max(picture.shape[1] // times, 1), max(picture.shape[0] // times, 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _scaling(across: float, down: float) -> Floats:
    """(3, 3) from pixels to those of a resized picture, both with OpenCV's pixel centres."""
    return np.array([[across, 0, (across - 1) / 2], [0, down, (down - 1) / 2], [0, 0, 1.0]])


def sweep(reference: Bytes, views: Sequence[View], levels: Floats, guide: Map) -> Costs:
    """Return the mismatch (h, k, w) of a frame (h, w, 4) at inverse depths (k,), in `STEPS` of a grey level.

    Costs are means over the neighbours of each side, gathered by a guided filter along the frame in grey
    levels (h, w), and the better side counts: a surface at a silhouette is hidden from one side only (Kang,
    Szeliski and Chai, "Handling occlusions in dense multi-view stereo", 2001; Hosni et al., "Fast cost-volume
    filtering", 2013).
    """
    height, width = guide.shape
    costs = np.empty((height, len(levels), width), np.uint16)
    # Every level of every pixel: levels around the result at half the size, with neighbours' and second best
    # ones, took 0.7 of the time, and lost bars of 2 to 6 pixels and 0.2 to 0.3 dB of walk. A window that
    # gathers costs wants one level for all of its pixels.
    # The result does not depend on their number.
    workers = threads()

    def fill(first: int) -> None:
        filtering = cv2.ximgproc.createGuidedFilter(guide, GUIDE_RADIUS, GUIDE_EPSILON)
        room = np.empty((2, *reference.shape), np.uint8)
        for k in range(first, len(levels), workers):
            checkpoint(k / len(levels))
            costs[:, k] = _mismatch(reference, views, float(levels[k]), filtering.filter, room)

    side_by_side(fill, range(workers))
    return _finished(costs, np.rint(np.linspace(0, STEPS * FAR_PREFERENCE, len(levels))).astype(np.uint16))


def _mismatch(
    reference: Bytes, views: Sequence[View], inverse: float, gather: Callable[[Map], Map], room: Bytes
) -> Costs:
    """(h, w) gathered mismatch with the neighbours of the better side, `UNSEEN` where none sees all of it."""
    height, width = reference.shape[:2]
    best, hidden = None, None
    # A guided filter averages twice over its radius.
    window = np.ones((4 * GUIDE_RADIUS + 1,) * 2, np.uint8)
    for side in sorted({view.side for view in views}):
        total = np.zeros((height, width), np.uint8)
        count = np.zeros_like(total)
        for view in views:
            ahead = view.sees_plane(inverse, width, height)
            if view.side != side or not ahead:
                continue
            seen = view.warped(inverse, width, height, room[0])
            off = cv2.cvtColor(cv2.absdiff(reference, seen, dst=room[1]), cv2.COLOR_RGBA2GRAY)
            valid = cv2.compare(cv2.extractChannel(seen, 3), 254, cv2.CMP_GE)  # type: ignore[call-overload]
            cv2.add(total, cv2.min(off, TRUNCATION), dst=total, mask=valid)  # type: ignore[call-overload]
            cv2.add(count, 1, dst=count, mask=valid)  # type: ignore[call-overload]
        unseen = cv2.compare(count, 0, cv2.CMP_EQ)  # type: ignore[call-overload]
        cv2.add(total, TRUNCATION, dst=total, mask=unseen)  # type: ignore[call-overload]
        mean = cv2.divide(total, cv2.max(count, 1), scale=STEPS, dtype=cv2.CV_32F)  # type: ignore[call-overload]
        cost = gather(np.asarray(mean, np.float32))
        best = cost if best is None else cv2.min(best, cost)
        around = cv2.dilate(unseen, window, borderValue=0)
        hidden = around if hidden is None else cv2.bitwise_and(hidden, around)
    # Negative values of the filter become 0.
    found = np.asarray(cv2.add(best, 0, dtype=cv2.CV_16U), np.uint16)  # type: ignore[call-overload]
    found[np.asarray(hidden) > 0] = UNSEEN
    return found


def _finished(costs: Costs, preferred: Costs) -> Costs:
    """Costs (h, k, w) plus the preference (k,) for far levels, with `UNSEEN` replaced by the least cost."""
    for row in costs:
        unseen = row == UNSEEN
        row += preferred[:, None]
        if unseen.any():
            row[unseen] = UNSEEN
            best = row.min(axis=0)
            np.copyto(row, np.where(best == UNSEEN, np.uint16(0), best), where=unseen)
    return costs


def exposed_as(picture: Bytes, own: Bytes, theirs: Bytes) -> Bytes:
    """Return a picture (h, w, 3), display-encoded, with the brightness of a frame in each channel.

    The factor is the median over places that both show: the frame's colours (n, 3) and the picture's (n, 3).
    The picture is unchanged if they hardly differ, or if all places are clipped.
    """
    clear = np.maximum(own, theirs).max(axis=1, initial=0) < CLIPPED
    if not clear.any():
        return picture
    gain = np.median((own[clear] + FOOT) / (theirs[clear] + FOOT), axis=0)
    if np.abs(gain - 1).max() < LEAST_GAIN:
        return picture
    levels = (np.arange(256)[:, None] + FOOT) * gain - FOOT
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(np.ascontiguousarray(picture), table[None]), np.uint8)
