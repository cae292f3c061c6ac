"""2D feature tracks through a clip: corners followed by optical flow, checked there and back.

Shi and Tomasi, "Good features to track", 1994; Lucas and Kanade in pyramids (Bouguet, 2001). As accurate
as SIFT on video, two to three times cheaper, and it keeps its points where texture is weak.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .errors import UserError
from .footage import Footage, to_gray8
from .reconstruction import Floats, Ints

LONG_SIDE = 960
"""Pixels; larger frames are shrunk for tracking."""
CELLS = 36
"""The long side is divided into this many cells, each of which is kept filled with points."""
MAX_ROUND_TRIP = 0.5
"""Pixels at tracking size between a point and where flow there and back puts it."""
WINDOW = (15, 15)
LEVELS = 4
BORDER = 4
"""Pixels at the frame's edge where no corner is taken."""
QUALITY = 0.002
"""Smallest eigenvalue of a corner relative to the frame's strongest."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Tracks:
    """Observations of features, sorted by frame."""

    frames: tuple[int, ...]
    """Frame numbers of the clip."""
    width: int
    height: int
    frame_index: Ints
    """(m,) index into `frames`."""
    track: Ints
    """(m,) track number, 0 to `count` - 1."""
    xy: Floats
    """(m, 2) pixels of the source frame, first pixel centre at (0.5, 0.5)."""
    rgb: NDArray[np.uint8]
    """(count, 3) sRGB colour where the track begins."""

    @property
    def count(self) -> int:
        return len(self.rgb)

    def in_frame(self, index: int) -> tuple[Ints, Floats]:
        """Track numbers (n,), ascending, and positions (n, 2) of one frame."""
        low, high = np.searchsorted(self.frame_index, [index, index + 1])
        return self.track[low:high], self.xy[low:high]


def track_features(footage: Footage, progress: Progress) -> Tracks:
    """Follow corners through all frames of the clip; UserError where there are too few to follow."""
    if len(footage.frames) < 3:
        raise UserError(
            f"{footage.path.name} has {len(footage.frames)} frame(s); at least 3 with a moving camera are"
            " needed"
        )
    zoom = min(1.0, LONG_SIDE / max(footage.width, footage.height))
    numbers: list[NDArray[np.int64]] = []
    places: list[NDArray[np.float32]] = []
    colours: list[NDArray[np.uint8]] = []
    active = np.zeros((0, 2), np.float32)
    active_numbers = np.zeros(0, np.int64)
    before: NDArray[np.uint8] | None = None
    born = 0
    for index, frame in enumerate(footage.frames):
        progress("Tracking features", index, len(footage.frames))
        picture = footage.read(frame)
        gray = _shrunk(to_gray8(picture), zoom)
        if before is not None:
            active, kept = follow(before, gray, active)
            active_numbers = active_numbers[kept]
        fresh = new_corners(gray, active)
        colours.append(_colours(picture, fresh, zoom))
        active = np.concatenate([active, fresh])
        active_numbers = np.concatenate([active_numbers, born + np.arange(len(fresh))])
        born += len(fresh)
        numbers.append(active_numbers)
        places.append(active)
        before = gray
    # The shrunk size is rounded, so that its two scales differ a little.
    scale = np.array([footage.width / gray.shape[1], footage.height / gray.shape[0]])
    xy = (np.concatenate(places).astype(np.float64) + 0.5) * scale
    return Tracks(
        footage.frames, footage.width, footage.height,
        np.repeat(np.arange(len(numbers)), [len(n) for n in numbers]).astype(np.int32),
        np.concatenate(numbers).astype(np.int32), xy, np.concatenate(colours),
    )  # fmt: skip


def follow(
    before: NDArray[np.uint8], after: NDArray[np.uint8], points: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Positions (k, 2) in `after` of those of (n, 2) points that flow there and back agrees on, and which."""
    if not len(points):
        return points, np.zeros(0, bool)
    options = {"winSize": WINDOW, "maxLevel": LEVELS}
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, points, None, **options)  # type: ignore[call-overload]
    back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, **options)  # type: ignore[call-overload]
    size = np.array([after.shape[1], after.shape[0]])
    good = (found.ravel() == 1) & (returned.ravel() == 1)
    good &= np.linalg.norm(back - points, axis=1) < MAX_ROUND_TRIP
    good &= np.all((there >= 0) & (there <= size - 1), axis=1)
    return there[good], good


def new_corners(gray: NDArray[np.uint8], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Corners (k, 2) for the cells of the frame that hold no point: borders and weak regions included.

    The strongest corner of each empty cell, if it is a corner at all.
    """
    height, width = gray.shape
    cell = int(np.ceil(max(width, height) / CELLS))
    strength = cv2.cornerMinEigenVal(gray, 3)
    least = max(QUALITY * float(strength.max()), 1e-6)
    # The flow's window would reach over the border.
    strength[:BORDER] = strength[-BORDER:] = strength[:, :BORDER] = strength[:, -BORDER:] = 0
    across, down = -(-width // cell), -(-height // cell)
    filled = np.zeros((down, across), bool)
    if len(points):
        at = np.clip(np.round(points).astype(int), 0, [width - 1, height - 1])
        filled[at[:, 1] // cell, at[:, 0] // cell] = True
        # A second point on the same corner, just over a cell's edge, adds nothing.
        free = np.ones(gray.shape, np.uint8)
        free[at[:, 1], at[:, 0]] = 0
        strength[cv2.distanceTransform(free, cv2.DIST_L2, 3) < cell / 3] = 0
    padded = np.zeros((down * cell, across * cell), np.float32)
    padded[:height, :width] = strength
    cells = padded.reshape(down, cell, across, cell).swapaxes(1, 2).reshape(down * across, cell * cell)
    inside = cells.argmax(axis=1)
    wanted = (cells.max(axis=1) > least) & ~filled.ravel()
    number = np.nonzero(wanted)[0]
    rows = number // across * cell + inside[wanted] // cell
    columns = number % across * cell + inside[wanted] % cell
    corners = np.stack([columns, rows], axis=1).astype(np.float32)
    if not len(corners):
        return corners
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 10, 0.02)
    refined = cv2.cornerSubPix(gray, corners[:, None].copy(), (3, 3), (-1, -1), criteria)[:, 0]
    steady = np.linalg.norm(refined - corners, axis=1) < 3
    return np.where(steady[:, None], refined, corners).astype(np.float32)


def _shrunk(gray: NDArray[np.uint8], zoom: float) -> NDArray[np.uint8]:
    if zoom == 1.0:
        return gray
    size = (round(gray.shape[1] * zoom), round(gray.shape[0] * zoom))
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _colours(picture: NDArray[np.generic], corners: NDArray[np.float32], zoom: float) -> NDArray[np.uint8]:
    size = [picture.shape[1] - 1, picture.shape[0] - 1]
    at = np.clip(((corners + 0.5) / zoom).astype(int), 0, size)
    picked = picture[at[:, 1], at[:, 0]][:, :3]
    if picked.dtype == np.float32:
        picked = 255 * np.clip(picked.astype(np.float64), 0, 1) ** (1 / 2.2)
    elif picked.dtype == np.uint16:
        picked = picked.astype(np.int64) >> 8
    return np.asarray(picked, dtype=np.uint8)
