"""Points that are followed by optical flow from frame to frame, with new ones wherever there are none.

Lucas and Kanade in pyramids (Bouguet, 2001), checked there and back. All places here are OpenCV's, the first
pixel's middle at (0, 0), and of the size that is tracked at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bytes, Mask
from .template_tracking import Patches, Rows

Places = NDArray[np.float32]
Numbers = NDArray[np.int64]
Detector = Callable[[Bytes, Places], Places]
# Cells of a frame. Chosen by inspection of tracks.
CELLS = 36
"""Cells along the frame's long side, each of which is kept filled with points."""
AROUND = 2
"""Cells to every side in which a point's neighbours are looked for."""
MIN_NEIGHBOURS = 6
"""Least neighbours for a test of a point's motion."""
SAME_MOTION = 0.3
"""Difference of motion from its neighbours that is always allowed, relative to its motion."""
# Corners and the optical flow that follows them. Chosen by inspection of tracks.
MAX_ROUND_TRIP = 0.5
"""Pixels between a point and where flow there and back puts it, at most."""
WINDOW = (9, 9)
"""Pixels across the flow's window along x and y. It is small, so that few windows contain two surfaces;
`Patches` corrects its errors."""
LEVELS = 4
"""Highest level of the flow's pyramid, 0 being the frame itself."""
BORDER = 4
"""Pixels at the frame's edge where no corner is taken: the flow's window would reach over it."""
QUALITY = 0.002
"""Least smaller eigenvalue of a corner's structure tensor, as a share of the frame's largest; Harris's
response is about its square."""
MIN_STRENGTH = 1e-12
"""Eigenvalue or response of a corner at least, whatever the frame: a plain one has none."""
HARRIS_K = 0.04
"""Weight of the squared trace in Harris's response, as he chose it."""
MIN_FOUND = 0.5
"""Share of the points that should be found again; else the picture has jumped, flashed, or been cut."""
MIN_LEFT = 0.1
"""Share of the points below which those found again are chance, and count as lost."""
PATIENCE = 3
"""Frames after which points that were lost all at once are given up."""
AS_ALIKE, ALIKE = 1.2, 0.02
"""A point moves like its neighbours if it looks alike there: one minus the correlation with its patch is less
than so many times that where flow puts it, or than so much. With 1.5 points beside depth jumps are off (0.9
quantile 2.1 instead of under 2 %, `test_known_poses`), with 0.0 up to four bars are taken for the next."""
JUMP = 1.0
"""Pixels in one frame by which a point may move otherwise than before, or than its neighbours."""
COARSE_SCALE = 4
"""Times that frames are made smaller where texture is so weak that only large features stand out."""
COARSE_CELLS = 12
"""Cells along the long side of a smaller frame that are kept filled."""
COARSE_QUALITY = 0.0002
"""As `QUALITY`, for corners of a smaller frame."""


@dataclass
class _Points(Rows):
    """Points of one frame and their tracks' numbers, ascending."""

    numbers: Numbers
    places: Places
    moves: Places
    """(n, 2) from the frame before, NaN where a point is new."""
    patches: Patches

    @classmethod
    def new(cls, first: int, places: Places) -> _Points:
        count = len(places)
        moves = np.full((count, 2), np.nan, np.float32)
        return cls(first + np.arange(count), places, moves, Patches.unknown(count))

    def __len__(self) -> int:
        return len(self.numbers)


class KLTTracker:
    """Follows points through frames that are shown to it one after the other."""

    def __init__(self, detect: Detector) -> None:
        """`detect` finds new points (k, 2) in a frame (H, W) beside those there are (n, 2)."""
        self._detect = detect
        self._born = 0
        self._before: Bytes | None = None
        self._points = _Points.new(0, np.zeros((0, 2), np.float32))
        self._lost: tuple[Bytes, _Points, int] | None = None

    def step(self, gray: Bytes) -> tuple[Numbers, Places]:
        """Track numbers (n,), ascending, and places (n, 2) in the next frame (H, W)."""
        if self._before is not None:
            self._follow(self._before, gray)
        fresh = _Points.new(self._born, self._detect(gray, self._points.places))
        self._born += len(fresh)
        self._points = self._points.joined(fresh)
        self._points.patches.learn(gray.astype(np.float32), self._points.places)
        self._before = gray
        return self._points.numbers, self._points.places

    @property
    def lost(self) -> bool:
        """All points that there were have just been lost at once."""
        return self._lost is not None and self._lost[2] == 0

    def forget(self) -> None:
        """Begin anew in the next frame."""
        self._before, self._lost = None, None
        self._points = _Points.new(self._born, np.zeros((0, 2), np.float32))

    def _follow(self, before: Bytes, gray: Bytes) -> None:
        old, self._points = self._points, _tracked(before, self._points, gray)
        if len(self._points) < MIN_LEFT * len(old):
            self._points = self._points.kept(np.zeros(len(self._points), bool))
            if self._lost is None:
                self._lost = (before, old, 0)
                return
        if self._lost is not None:
            # A flash lasts a frame or two, and then the points are where they were before it.
            seen, lost, age = self._lost
            again = _tracked(seen, lost, gray)
            self._lost = (seen, lost, age + 1) if age + 1 < PATIENCE else None
            if len(again) >= MIN_FOUND * len(lost):
                self._points, self._lost = again.joined(self._points), None


class TwoScales:
    """Follows small features and, where a frame has none, large ones in frames made smaller."""

    def __init__(self, detect: Detector) -> None:
        """As `KLTTracker`'s."""
        self._fine, self._coarse = KLTTracker(detect), KLTTracker(self._weak)
        self._names = [np.zeros(0, np.int64), np.zeros(0, np.int64)]
        self._taken = np.zeros((0, 2), np.float32)

    def step(self, gray: Bytes) -> tuple[Numbers, Places]:
        """Return IDs (n,) and places (n, 2) in pixels of a frame's (h, w) points, from both scales."""
        number, place = self._fine.step(gray)
        size = tuple(max(side // COARSE_SCALE, 1) for side in gray.shape[::-1])
        zoom = np.array(gray.shape[::-1]) / size
        self._taken = ((place + 0.5) / zoom - 0.5).astype(np.float32)
        if self._fine.lost:
            # Too few to know by themselves chance from a cut.
            self._coarse.forget()
        rough, at = self._coarse.step(cv2.resize(gray, size, interpolation=cv2.INTER_AREA))
        numbers = np.concatenate([self._named(0, number), self._named(1, rough)])
        places = np.concatenate([place, ((at + 0.5) * zoom - 0.5).astype(np.float32)])
        order = np.argsort(numbers)
        return numbers[order], places[order]

    def _weak(self, gray: Bytes, points: Places) -> Places:
        points = np.concatenate([points, self._taken])
        return strongest_corners(gray, points, cv2.cornerMinEigenVal(gray, 3), COARSE_QUALITY, COARSE_CELLS)

    def _named(self, which: int, numbers: Numbers) -> Numbers:
        """One follower's track numbers among both's."""
        names, other = self._names[which], self._names[1 - which]
        count = int(numbers[-1]) + 1 - len(names) if len(numbers) else 0
        if count > 0:
            first = len(names) + len(other)
            self._names[which] = names = np.concatenate([names, first + np.arange(count)])
        return np.asarray(names[numbers])


def _tracked(before: Bytes, points: _Points, after: Bytes) -> _Points:
    """The points of one frame that are found again in another, there."""
    found = _found(points, *follow(before, after, points.places, None), before, after)
    if len(found) >= MIN_FOUND * len(points):
        return found
    # Light that changes and moves that are too long for flow are taken out first.
    alike = same_brightness(after, before)
    moved = follow(before, alike, points.places, shift(before, alike))
    return max(found, _found(points, *moved, before, after), key=len)


def _found(points: _Points, places: Places, kept: Mask, before: Bytes, after: Bytes) -> _Points:
    """The points that were kept (n,), at their places in `after`, without those that went elsewhere."""
    found = points.kept(kept)
    old, last = found.places, found.moves
    gray = after.astype(np.float32)
    found.places, good = found.patches.refined(gray, places)
    cell = cell_size(before, CELLS)
    _move_with_neighbours(found, old, gray, cell)
    found.moves = found.places - old
    good &= ~motion_outliers(old, found.places, last, cell)
    return found.kept(good)


def _move_with_neighbours(found: _Points, old: Places, gray: Places, cell: int) -> None:
    """Move points from `old` (n, 2) as their neighbours do, where they look as much alike there.

    Flow in small pictures takes one of many equal bars for the next one: always by one, so that the track is
    that of a point at another distance.
    """
    usual = neighbour_motion(old, found.places, 2 * cell)
    with np.errstate(invalid="ignore"):
        rows = np.nonzero(np.linalg.norm(found.places - old - usual, axis=1) > JUMP)[0]
    rows = rows[found.patches.known[rows]]
    if not len(rows):
        return
    other = found.patches.kept(rows)
    there, _ = other.refined(gray, old[rows] + usual[rows])
    apart = np.linalg.norm(there - found.places[rows], axis=1)
    here = found.patches.kept(rows).unlike(gray, found.places[rows])
    better = (apart > JUMP) & (other.unlike(gray, there) < np.maximum(AS_ALIKE * here, ALIKE))
    found.places[rows[better]], found.patches.map[rows[better]] = there[better], other.map[better]


def follow(
    before: Bytes, after: Bytes, points: Places, guess: tuple[float, float] | None = None
) -> tuple[Places, Mask]:
    """Positions (k, 2) in `after` of those of (n, 2) points that flow there and back agrees on, and which.

    `guess` is about how far the picture as a whole has moved, in pixels, if it is far.
    """
    if not len(points):
        return points, np.zeros(0, bool)
    flow = {"winSize": WINDOW, "maxLevel": LEVELS}
    there = back = None
    if guess is not None:
        flow["flags"] = cv2.OPTFLOW_USE_INITIAL_FLOW
        there, back = (points + guess).astype(np.float32), points.copy()
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, points, there, **flow)  # type: ignore[call-overload]
    back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, there, back, **flow)  # type: ignore[call-overload]
    size = np.array([after.shape[1], after.shape[0]])
    good = (found.ravel() == 1) & (returned.ravel() == 1)
    good &= np.linalg.norm(back - points, axis=1) < MAX_ROUND_TRIP
    good &= np.all((there >= 0) & (there <= size - 1), axis=1)
    return there[good], good


def motion_outliers(before: Places, after: Places, moves: Places, cell: int) -> Mask:
    """Return the points (n,) that jumped: that moved unlike all their neighbours, and unlike before.

    Only gross errors count. Things that move together stay, and so does a lone near point before a far wall,
    which no epipolar geometry could separate from an error: with a wall alone it is undetermined.

    Args:
        before: (n, 2).
        after: (n, 2).
        moves: (n, 2) motion before.
        cell: Side of a cell in pixels.
    """
    jumped: Mask = np.linalg.norm(after - before - moves, axis=1) > JUMP
    if not jumped.any():
        return jumped
    alike, judged = neighbour_consistency(before, after, cell, JUMP)
    return np.asarray(jumped & judged & ~alike)


def neighbour_consistency(before: Places, after: Places, cell: int, jump: float) -> tuple[Mask, Mask]:
    """Return (n,) which points moved like two others in the cells around, and which have enough others there.

    Alike is by less than `jump` pixels, or a share of the move. One other may be chance.
    """
    if not len(before):
        return np.zeros(0, bool), np.zeros(0, bool)
    move, (beside, other) = after - before, _beside(before, cell)
    apart = np.where(other, np.linalg.norm(move[beside] - move[:, None], axis=2), np.inf)
    allowed = np.maximum(jump, SAME_MOTION * np.linalg.norm(move, axis=1))
    return np.partition(apart, 1, axis=1)[:, 1] < allowed, other.sum(axis=1) >= MIN_NEIGHBOURS


def neighbour_motion(before: Places, after: Places, cell: int) -> Places:
    """Return the median motion (n, 2) of the points in the cells around each; NaN where they are too few."""
    if not len(before):
        return before
    beside, other = _beside(before, cell)
    other &= (other.sum(axis=1) >= MIN_NEIGHBOURS // 2)[:, None]
    move = np.where(other[..., None], (after - before)[beside], np.float32(np.inf))
    middle = np.maximum(other.sum(axis=1) - 1, 0) // 2
    median = np.sort(move, axis=1)[np.arange(len(before)), middle]
    return np.where(np.isfinite(median), median, np.float32(np.nan))


def _beside(before: Places, cell: int) -> tuple[NDArray[np.intp], Mask]:
    """(n, k) points in the cells around each of (n, 2), and which of them are there and others."""
    around = AROUND
    column, row = (before // cell).astype(int).T + around
    held = np.full((row.max() + around + 1, column.max() + around + 1), -1)
    held[row, column] = np.arange(len(before))
    offset = np.arange(-around, around + 1)
    beside = held[row[:, None, None] + offset[:, None], column[:, None, None] + offset].reshape(len(row), -1)
    return beside, (beside >= 0) & (beside != np.arange(len(before))[:, None])


def same_brightness(gray: Bytes, other: Bytes) -> Bytes:
    """Return a picture with the histogram of another: its own tones in the other's shades."""
    counts = [np.bincount(p.ravel(), minlength=256) / p.size for p in (gray, other)]
    # The middle of each step: clipped tones get the middle of their input range.
    here, there = (np.cumsum(count) - count / 2 for count in counts)
    shades = np.rint(np.interp(here, there, np.arange(256))).astype(np.uint8)
    return np.asarray(cv2.LUT(gray, shades), np.uint8)


def shift(before: Bytes, after: Bytes) -> tuple[float, float]:
    """Return the motion of the whole picture in pixels along x and y (phase correlation)."""
    size = (max(before.shape[1] // 4, 2), max(before.shape[0] // 4, 2))
    a, b = (cv2.resize(p, size, interpolation=cv2.INTER_AREA).astype(np.float32) for p in (before, after))
    (x, y), _ = cv2.phaseCorrelate(a, b, cv2.createHanningWindow(size, cv2.CV_32F))
    return x * before.shape[1] / size[0], y * before.shape[0] / size[1]


def cell_size(picture: Bytes | Places, cells: int) -> int:
    """Return the side in pixels of a picture's (H, W) cells, by their number along the long side."""
    return int(np.ceil(max(picture.shape) / cells))


def new_corners(gray: Bytes, points: Places) -> Places:
    """Return the strongest corner (k, 2) of each cell of a frame (H, W) without a point (n, 2), if it is one.

    Harris and Stephens, "A combined corner and edge detector", 1988. Borders and weak regions are included.
    """
    return strongest_corners(gray, points, cv2.cornerHarris(gray, 3, 3, HARRIS_K), QUALITY**2, CELLS)


def strongest_corners(gray: Bytes, points: Places, strength: Places, quality: float, cells: int) -> Places:
    """Return the strongest corner (k, 2) of each cell without a point, refined to a fraction of a pixel.

    Args:
        gray: (H, W) frame.
        points: (n, 2) places of the points that the frame has.
        strength: (H, W) strength of corners; its border is set to 0.
        quality: Least strength of a corner, as a share of the largest.
        cells: Number of cells along the longer side.
    """
    least = max(quality * float(strength.max()), MIN_STRENGTH)
    edge = BORDER
    strength[:edge] = strength[-edge:] = strength[:, :edge] = strength[:, -edge:] = 0
    corners = best_of_cells(strength, least, points, cells).astype(np.float32)
    # OpenCV refines nothing in pictures that are hardly larger than its window.
    if not len(corners) or min(gray.shape) < 11:
        return corners
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 10, 0.02)
    refined = cv2.cornerSubPix(gray, corners[:, None].copy(), (3, 3), (-1, -1), criteria)[:, 0]
    steady = np.linalg.norm(refined - corners, axis=1) < 3
    return np.where(steady[:, None], refined, corners).astype(np.float32)


def best_of_cells(strength: Places, least: float, points: Places, cells: int) -> NDArray[np.intp]:
    """Return columns and rows (k, 2) of the strongest pixel of each cell without a point (n, 2)."""
    height, width = strength.shape
    cell = cell_size(strength, cells)
    across, down = -(-width // cell), -(-height // cell)
    filled = np.zeros((down, across), bool)
    if len(points):
        at = np.clip(np.round(points).astype(int), 0, [width - 1, height - 1])
        filled[at[:, 1] // cell, at[:, 0] // cell] = True
        # A second point on the same corner, just over a cell's edge, adds nothing.
        free = np.ones(strength.shape, np.uint8)
        free[at[:, 1], at[:, 0]] = 0
        strength = np.where(cv2.distanceTransform(free, cv2.DIST_L2, 3) < cell / 3, 0, strength)
    padded = np.zeros((down * cell, across * cell), np.float32)
    padded[:height, :width] = strength
    tiles = padded.reshape(down, cell, across, cell).swapaxes(1, 2).reshape(down * across, cell * cell)
    number = np.nonzero((tiles.max(axis=1) > least) & ~filled.ravel())[0]
    row, column = np.divmod(tiles.argmax(axis=1)[number], cell)
    return np.stack([number % across * cell + column, number // across * cell + row], axis=1)
