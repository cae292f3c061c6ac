"""Overlays that are burnt into a clip and stay in place: bars at the border, logos and timecodes.

Bars are rows and columns of one colour behind a straight edge. Logos and text are pixels that keep their
colour while what is right beside them changes, as in Meisinger et al., "Automatic TV logo removal using
statistical based logo detection and frequency selective inpainting", 2005. Only what is sure is found: before
a still camera everything keeps its colour, so that only black bars can be known there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Indices, Mask
from ..base.nearest_fill import of_nearest
from ..base.options import Option
from ..base.store import NOT_KEPT, Entry, Store
from ..camera.canvas import Canvas
from .light import to_gray8, to_rgb8
from .picture_file import Pixels

FIXED = Option(
    "Keep Bars and Logos",
    "Find what is burnt into the clip and never moves, such as black bars, a logo or a timecode, leave it out"
    " of tracking and depth, and keep it as it is in the result",
    True,
    name="fixed",
)
SAMPLED = 12
"""Frames of a clip that are compared."""
GUARD = 2
"""Pixels beside a fixed area whose colours coding mixes with its own: a pixel of chroma, twice as large, and
one of the filter between blocks (x264, crf 18 to 33)."""
CODED = 10
"""Pixels within which coding changes what is beside an edge: its transform and filter of blocks reach 8 to 10
(x264, crf 18 to 33)."""
BLACK = 24
"""Largest level of black, in full range as in limited."""
CLEAN = 5.0
"""Levels of 255 by which pixels of a bar differ from its colour, past `CODED`: 0 to 1 in the mean at crf 18
to 33. The picture beside it differs by twice as much."""
STEP = 2.5
"""Least ratio of these differences over a bar's edge, which soft edges lack: 4 and more at crf 28 beside a
dark picture."""
LONG_SIDE = 1280
"""Longest side in pixels of the pictures in which logos and text are found."""
CHANGED = 16
"""Levels of luma by which a pixel changes that moves; flat and fixed ones by up to 8 at crf 28."""
CONTRAST = 60
"""Levels between a fixed pixel at an edge and one beside it, in three of four frames: 95 and more in a real
logo, and in text at crf 28. It changes by a fifth of this contrast at most."""
DENSE = 0.12
"""Least share of such pixels in their box: 0.25 in the real logo, up to 0.05 in boxes of other clips."""
MOVES = 0.55
"""Least share of moving pixels in the picture, and around a logo, from which on still pixels are known to be
fixed."""


Fixed = Callable[[], Mask | None]
"""Returns the pixels (H, W) of all frames of a clip that do not show the scene; None if there are none."""


def nothing_fixed() -> None:
    """Return None, for a clip without a fixed area."""


@dataclass(frozen=True)
class FixedArea:
    """The fixed pixels of a clip, the same in all frames."""

    mask: Mask
    """(H, W)."""

    @property
    def note(self) -> str:
        """Sides and boxes of the overlays, for the user."""
        scene = cv2.boundingRect((~self.mask).astype(np.uint8))
        height, width = self.mask.shape
        left, top, right, bottom = scene[0], scene[1], scene[0] + scene[2], scene[1] + scene[3]
        sides = (("row", 0, top), ("row", bottom, height), ("column", 0, left), ("column", right, width))
        found = [f"{kind}s {low + 1} to {high}" for kind, low, high in sides if high > low]
        plates = np.ascontiguousarray(self.mask[top:bottom, left:right].astype(np.uint8))
        for x, y, across, down, _ in cv2.connectedComponentsWithStats(plates, connectivity=8)[2][1:]:
            found.append(f"{across}x{down} pixels at {left + x},{top + y}")
        return f"burnt into the clip, and kept as it is: {'; '.join(found)}"

    @cached_property
    def covered(self) -> Mask:
        """(H, W) pixels whose colours and depth are not the scene's: fixed ones, and `GUARD` around them."""
        around = np.ones((2 * GUARD + 1,) * 2, np.uint8)
        return np.asarray(cv2.dilate(self.mask.astype(np.uint8), around) > 0)

    @cached_property
    def _mirrored(self) -> tuple[Indices, Indices]:
        """Indices (n,) of the covered pixels, and of the scene's pixels that are mirrored into them."""
        height, width = self.mask.shape
        scene = ~self.covered
        number = np.arange(height * width, dtype=np.int32).reshape(height, width)
        at = np.flatnonzero(self.covered)
        nearest = of_nearest(number, scene)[0].ravel()[at]
        # A row beside the border mirrors the border's own row, as in a symmetric margin.
        row, column = (
            np.clip(2 * to - own + np.sign(own - to), 0, size - 1)
            for to, own, size in zip(
                np.divmod(nearest, width), np.divmod(at, width), (height, width), strict=True
            )
        )
        mirrored = row * width + column
        return at, np.where(scene.ravel()[mirrored], mirrored, nearest)

    def on_canvas(self, canvas: Canvas) -> Mask:
        """Return the covered pixels (h, w) of a canvas."""
        size = canvas.camera.width, canvas.camera.height
        return np.asarray(canvas.from_source(cv2.resize(self.covered.astype(np.float32), size)) > 0)

    def without(self, values: Pixels) -> Pixels:
        """Return a picture (H, W, c) with the scene mirrored into the covered pixels."""
        at, source = self._mirrored
        flat = values.reshape(-1, *values.shape[2:]).copy()
        flat[at] = flat[source]
        return flat.reshape(values.shape)


def fixed_area(
    read: Callable[[int], Pixels], frames: Sequence[int], store: Store = NOT_KEPT
) -> FixedArea | None:
    """Find the fixed area of a clip, or read it from its storage.

    Args:
        read: Reads a frame's picture (H, W, 3 or 4), as `Footage.read`.
        frames: Numbers of its frames.
        store: Its storage.

    Returns:
        The area; None if none is sure. That of three frames or fewer never is.

    Raises:
        UserError: A frame cannot be read.
    """
    entry = Entry[Bytes]("clip-fixed", ("mask",), lambda mask: {"mask": mask}, lambda parts: parts["mask"])
    mask = store.once(entry, lambda: _found(read, frames).astype(np.uint8)) > 0
    return FixedArea(mask) if mask.any() else None


def _found(read: Callable[[int], Pixels], frames: Sequence[int]) -> Mask:
    """The fixed pixels (H, W) of a clip."""
    chosen = sorted({frames[round(at)] for at in np.linspace(0, len(frames) - 1, SAMPLED)})
    pictures = [to_rgb8(read(frame)) for frame in chosen]
    height, width = pictures[0].shape[:2]
    mask = np.ones((height, width), bool)
    if len(pictures) < 4 or any(picture.shape[:2] != (height, width) for picture in pictures):
        return ~mask
    luma = np.stack([to_gray8(each, LONG_SIDE) for each in pictures])
    # In a short clip little changes, and every frame counts.
    odd = len(luma) // SAMPLED
    ordered = np.partition(luma, (odd, len(luma) - 1 - odd), axis=0)
    change = cv2.subtract(ordered[-1 - odd], ordered[odd])
    top, right, bottom, left = _bars(pictures, bool(np.mean(change > CHANGED) > MOVES / 2))
    mask[top : height - bottom, left : width - right] = False
    bars = cv2.resize(mask.astype(np.uint8), luma[0].shape[::-1], interpolation=cv2.INTER_NEAREST)
    logos = cv2.resize(_logos(luma, change, bars), (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(mask | (logos > 0))


def _bars(frames: list[Bytes], moves: bool) -> list[int]:
    """Pixels of the bars at the top, right, bottom and left of frames (H, W, 3)."""
    bars = [0] * 4
    # On the second way round, a bar opposite another one needs no visible edge.
    for turn in range(8):
        side, opposite = turn % 4, bars[turn % 4 - 2] if turn > 3 else 0
        if not bars[side] and (turn < 4 or opposite):
            bars[side] = _bar(frames, moves, opposite)
            frames = [each[bars[side] :] for each in frames]
        frames = [np.rot90(each) for each in frames]
    return bars


def _bar(frames: list[Bytes], moves: bool, opposite: int) -> int:
    """Rows of the bar at the top of frames (H, W, 3), 0 where it is not sure; as many as `opposite`."""
    colours = np.array([np.median(each[0], axis=0) for each in frames])
    rows = opposite or len(frames[0]) // 2
    if not rows or np.ptp(colours, axis=0).max() > CLEAN or not (moves or colours.max() <= BLACK):
        return 0
    distance = np.zeros((rows, frames[0].shape[1]), np.float32)
    for picture, colour in zip(frames, colours, strict=True):
        apart = cv2.absdiff(np.ascontiguousarray(picture[:rows]), np.array([*colour, 0.0]))
        cv2.accumulate(apart.max(axis=2), distance)
    distance /= np.float32(len(frames))
    if opposite:
        return opposite if np.mean(distance > CLEAN / 2) < 0.01 else 0
    # Columns that never leave the colour belong to bars at the sides.
    distance = distance[:, distance.max(axis=0, initial=0) > 2 * CLEAN]
    if min(distance.shape) <= 3 * CODED:
        return 0
    profile = np.median(distance, axis=1)
    beside = np.median(np.lib.stride_tricks.sliding_window_view(profile, 2 * CODED)[CODED:], axis=1)
    begins = np.flatnonzero(profile[2 : len(beside)] >= np.maximum(2 * CLEAN, beside[2:] / 2))
    if not len(begins):
        return 0
    bar = int(begins[0]) + 2
    core = distance[: max(bar - CODED, 1)].max(axis=0)
    before, after = distance[max(bar - 4, 0) : bar - 1].mean(axis=0), distance[bar : bar + 3].mean(axis=0)
    # Not where there is text in it, a soft edge, or the picture has its colour.
    agree = (core <= np.maximum(CLEAN, after / 10)) & (after > STEP * before + 1)
    return bar if np.mean(agree) >= 0.5 else 0


def _logos(luma: Bytes, change: Bytes, bars: Bytes) -> Bytes:
    """The pixels (h, w) of logos and text beside bars (h, w), 0 or 1.

    `luma` (n, h, w) is that of the frames, `change` (h, w) the levels by which it changes.
    """
    found, (height, width) = np.zeros_like(change), change.shape
    inside = cv2.dilate(bars, np.ones((2 * CODED + 1,) * 2, np.uint8)) == 0
    moving = inside & (change > CHANGED)
    if moving.sum() < MOVES * inside.sum():
        return found
    steps = [cv2.morphologyEx(each, cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) for each in luma]
    contrast = np.partition(steps, len(steps) // 4, axis=0)[len(steps) // 4]
    edges = inside & (contrast >= CONTRAST) & (change <= contrast // 5)
    near = max(height, width) // 64 | 1
    letters = np.ones((near // 2 | 1, near), np.uint8)
    joined = cv2.morphologyEx(edges.astype(np.uint8), cv2.MORPH_CLOSE, letters)
    _, label, boxes, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    # Flat pixels that are steady without an edge belong to a logo where they are connected to its edges.
    flat = (inside & (change <= CHANGED // 2)).astype(np.uint8)
    steady = cv2.morphologyEx(flat, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) | edges
    part = cv2.connectedComponents(steady)[1]
    for number, (_, _, across, down, _) in enumerate(boxes[1:], 1):
        own = edges & (label == number)
        if own.sum() < max(2 * near, DENSE * across * down) or min(across, down) < 4:
            continue
        area = np.argwhere(np.isin(part, part[own]))[:, ::-1]
        # Digits that change are within the hull of their outlines, or of their plate.
        logo = cv2.fillConvexPoly(np.zeros_like(change), cv2.convexHull(area.astype(np.int32)), 1)
        x, y, across, down = cv2.boundingRect(logo)
        around = np.zeros_like(inside)
        around[max(y - CODED, 0) : y + down + CODED, max(x - CODED, 0) : x + across + CODED] = True
        around[y : y + down, x : x + across] = False
        around &= inside
        # The camera often follows a subject that stays in the middle.
        middle = logo[height // 4 : -(height // 4), width // 4 : -(width // 4)]
        if not middle.any() and moving[around].sum() >= MOVES * around.sum():
            found |= cv2.dilate(logo, np.ones((3, 3), np.uint8))
    return found
