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

from ..base.arrays import Bytes, Indices, Map, Mask
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
# Bars. Distances are mean largest differences of a channel from the bar's colour, in levels of 255.
WIDEST = 0.36
"""Share of a side that a bar covers at most: 9:16 within 16:9 leaves 0.34 on either side."""
NARROWEST = 2
"""Pixels of the narrowest bar."""
SPREAD = 4
"""Levels by which the colour of a bar differs between frames at most."""
CODED = 10
"""Pixels beside an edge within which coding changes a bar: its transform and filter of blocks reach 8 to 10
(x264, crf 18 to 33)."""
CLEAN = 2.5
"""Distance from its colour in a bar, past `CODED`: 0 to 1 at crf 18 to 33; in a dark clip's sensor noise, 2
and more."""
SHOWN = 8.0
"""Least distance of the picture beside a bar."""
STEP = 2.5
"""Least ratio of distances over a bar's edge, which soft edges lack: 4 and more at crf 28 beside a dark
picture."""
AGREE = 0.5
"""Least share of a bar's length along which the edge is seen in its place."""
WRITTEN = 0.4
"""Largest share of a bar's length that text in it covers."""
BLACK = 24
"""Largest level of black, in full range as in limited."""
# Logos and text. Levels of 255 of luma, in pictures of `LONG_SIDE`.
LONG_SIDE = 1280
"""Longest side in pixels of the pictures in which logos and text are found."""
STEADY = 8
"""Levels by which a pixel changes that is flat and fixed: 1 in the median, and up to 8, at crf 28."""
CHANGED = 16
"""Levels by which a pixel changes that moves."""
OUTLINED = 24
"""Levels by which a fixed pixel changes beside an edge, where coding is coarser: 9 in the median of a real
logo, and of text at crf 28; 20 in one of ten."""
CONTRAST = 60
"""Levels between such a pixel and one beside it, in three of four frames: 95 and more in those. It changes by
a fifth of this contrast at most. With half of it, parts of the scene before a nearly still camera are found
in 6 of 27 clips without a logo, by `tests/media/test_fixed_area.py`."""
DENSE = 0.12
"""Least share of such pixels in their box: 0.25 in the real logo, up to 0.05 in boxes of other clips."""
FEWEST = 40
"""Least number of them: 400 and more in logos of 80x20 pixels, up to 50 in the scene."""
MOVES = 0.5
"""Least share of the picture that moves, from which on still pixels are known to be fixed: 0.55 to 1 in clips
of a moving camera."""
LOOSE = 0.03
"""Largest share of contrasts elsewhere that are as steady: up to 0.002 in those, all in a still scene."""
RING = 0.6
"""Least share of pixels around a logo that move."""
LARGEST = 0.06
"""Largest share of the picture of a logo or text."""
MIDDLE = 0.25
"""Half sides of the picture's middle, as shares: the camera often follows a subject that stays there."""
FULL, WHOLE = 0.65, 0.9
"""Least shares of its box that a rectangular plate fills, without the digits that change and with them: 0.79
are a disc, 0.5 is text."""
INK = 0.06
"""Least share of changing digits' box in the colours of fixed ones: 0.1 and more of a 1, the narrowest."""


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
    clip = _Changes.of(pictures)
    top, bottom, left, right = _bars(pictures, clip.moves(np.s_[:, :]) > MOVES / 2)
    mask[top : height - bottom, left : width - right] = False
    for plate in _plates(clip, mask):
        mask |= plate > 0
    return mask


def _bars(pictures: list[Bytes], moves: bool) -> tuple[int, int, int, int]:
    """Pixels of the bars at the top, bottom, left and right."""
    top, bottom = _two_bars(pictures, moves)
    inside = slice(top, pictures[0].shape[0] - bottom)
    return top, bottom, *_two_bars([each[inside].swapaxes(0, 1) for each in pictures], moves)


def _two_bars(pictures: list[Bytes], moves: bool) -> tuple[int, int]:
    """Rows of the bars at the top and the bottom; where one is sure, the other needs no visible edge."""
    first, last = (_distances(each, moves) for each in (pictures, [each[::-1] for each in pictures]))
    top, bottom = _bar(first), _bar(last)
    return top or bottom * _is_plain(first[:bottom]), bottom or top * _is_plain(last[:top])


def _is_plain(rows: Map) -> bool:
    """Whether rows (h, w) of distances have one colour."""
    return bool(len(rows) and np.mean(rows > CLEAN) < 0.01)


def _distances(pictures: list[Bytes], moves: bool) -> Map:
    """(h, w) mean distances of the first rows from the colour of the outermost; empty without one colour."""
    colours = np.array([np.median(each[0], axis=0) for each in pictures])
    total = np.zeros((int(WIDEST * pictures[0].shape[0]) + 2 * CODED, pictures[0].shape[1]), np.float32)
    if np.ptp(colours, axis=0).max() > SPREAD or not (moves or colours.max() <= BLACK):
        return total[:0]
    total = total[: pictures[0].shape[0]]
    for picture, colour in zip(pictures, colours, strict=True):
        apart = cv2.absdiff(np.ascontiguousarray(picture[: len(total)]), np.array([*colour, 0.0]))
        cv2.accumulate(apart.max(axis=2), total)
    return total / np.float32(len(pictures))


def _bar(distance: Map) -> int:
    """Rows of the bar in distances (h, w) from the first row on; 0 if that is not sure."""
    # Columns that never leave the colour belong to bars at the sides.
    distance = distance[:, distance.max(axis=0, initial=0) > SHOWN]
    if distance.shape[1] <= 2 * CODED:
        return 0
    profile = np.quantile(distance, AGREE, axis=1)
    starts = np.arange(NARROWEST, len(profile) - 3 * CODED)
    picture = np.median([profile[starts + CODED + n] for n in range(2 * CODED)], axis=0)
    begins = starts[profile[starts] >= np.maximum(SHOWN, picture / 2)]
    if not len(begins):
        return 0
    rows = int(begins[0])
    before, after = (
        distance[part].mean(axis=0) for part in (np.s_[max(rows - 4, 0) : rows - 1], np.s_[rows : rows + 3])
    )
    coded = max(CLEAN, float(np.median(after)) / 20) if rows <= CODED else CLEAN
    core = distance[: max(rows - CODED, NARROWEST // 2)]
    written = core.max(axis=0) > 2 * coded
    shown = after > STEP * before + 1
    is_sure = (
        written.mean() <= WRITTEN
        and core[:, ~written].mean() <= coded
        and np.median(after) > STEP * np.median(before)
        and np.mean(shown[~written]) >= AGREE
    )
    return rows if is_sure else 0


@dataclass(frozen=True)
class _Changes:
    """How the luma of a clip changes, in pictures of `LONG_SIDE`."""

    luma: Bytes
    """(n, h, w) of the frames."""
    change: Bytes
    """(h, w) levels by which pixels change."""
    contrast: Bytes
    """(h, w) levels by which pixels differ from those within two pixels, in three of four frames."""

    @classmethod
    def of(cls, pictures: list[Bytes]) -> _Changes:
        height, width = pictures[0].shape[:2]
        zoom = min(1.0, LONG_SIDE / max(height, width))
        size = max(round(width * zoom), 1), max(round(height * zoom), 1)
        luma = [cv2.resize(to_gray8(each), size, interpolation=cv2.INTER_AREA) for each in pictures]
        around = np.ones((5, 5), np.uint8)
        steps = [cv2.morphologyEx(each, cv2.MORPH_GRADIENT, around) for each in luma]
        # In a short clip little changes, and every frame counts.
        odd, quarter = len(luma) // SAMPLED, len(luma) // 4
        ordered = np.partition(luma, (odd, len(luma) - 1 - odd), axis=0)
        contrast = np.partition(steps, quarter, axis=0)[quarter]
        return cls(np.stack(luma), cv2.subtract(ordered[-1 - odd], ordered[odd]), contrast)

    def moves(self, where: tuple[slice, slice] | Mask) -> float:
        """Share of pixels of a part that move."""
        return float(np.mean(self.change[where] > CHANGED))


def _plates(clip: _Changes, bars: Mask) -> list[Bytes]:
    """Logos and text beside bars (H, W), each as its pixels (H, W), 0 or 1."""
    size = clip.change.shape[::-1]
    inside = cv2.resize((~bars).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    inside = cv2.erode(inside, np.ones((2 * CODED + 1,) * 2, np.uint8), borderValue=1) > 0
    if not inside.any() or clip.moves(inside) < MOVES:
        return []
    outlined = inside & (clip.contrast >= CONTRAST)
    edges = outlined & (clip.change <= np.minimum(OUTLINED, clip.contrast // 5))
    near = max(size) // 64 | 1
    joined = cv2.morphologyEx(
        edges.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((near // 2 | 1, near), np.uint8)
    )
    _, label, boxes, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    plates = [_plate(clip, edges & (label == k), inside) for k in range(1, len(boxes))]
    found = [plate for plate in plates if plate is not None]
    beside = np.all([plate == 0 for plate in found], axis=0)
    if np.count_nonzero(edges & beside) > LOOSE * np.count_nonzero(outlined & beside):
        return []
    return [cv2.resize(plate, bars.shape[::-1], interpolation=cv2.INTER_NEAREST) for plate in found]


def _plate(clip: _Changes, edges: Mask, inside: Mask) -> Bytes | None:
    """The pixels (h, w) of a logo or text with fixed edges (h, w), 0 or 1; None where it is not sure."""
    x, y, across, down = cv2.boundingRect(edges.astype(np.uint8))
    count = np.count_nonzero(edges)
    if count < max(FEWEST, DENSE * across * down) or min(across, down) < 4:
        return None
    height, width = edges.shape
    # Flat pixels that are steady without an edge belong to it where they are connected to its edges.
    reach = max(across, down)
    part = np.s_[max(y - reach, 0) : y + down + reach, max(x - reach, 0) : x + across + reach]
    flat = ((clip.change[part] <= STEADY) & inside[part]).astype(np.uint8)
    steady = cv2.morphologyEx(flat, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) | edges[part]
    _, label = cv2.connectedComponents(steady.astype(np.uint8))
    own = np.isin(label, np.setdiff1d(label[edges[part]], 0)).astype(np.uint8)
    outlines, _ = cv2.findContours(own, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    plate = np.zeros(edges.shape, np.uint8)
    cv2.drawContours(plate[part], outlines, -1, 1, cv2.FILLED)
    left, top, right, bottom = _box(plate)
    # Digits that change are holes in their plate; coding adds a few pixels around it.
    digit = np.ones((max(down // 2, 3),) * 2, np.uint8)
    closed = cv2.morphologyEx(plate, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    closed = cv2.morphologyEx(closed, cv2.MORPH_CLOSE, digit)
    box = np.s_[slice(*_box(closed)[1::2]), slice(*_box(closed)[::2])]
    if not closed.any() or plate[box].mean() < FULL or closed[box].mean() < WHOLE:
        left, right = _with_digits(clip.luma[:, y : y + down], edges[y : y + down], x, x + across)
        if right - left > across:
            plate[y : y + down, left:right] = 1
            left, top, right, bottom = _box(plate)
    else:
        plate[box] = 1
    middle = (
        abs((left + right) / 2 / width - 0.5) < MIDDLE and abs((top + bottom) / 2 / height - 0.5) < MIDDLE
    )
    around = np.zeros(edges.shape, bool)
    around[max(top - CODED, 0) : bottom + CODED, max(left - CODED, 0) : right + CODED] = True
    around[top:bottom, left:right] = False
    is_sure = not middle and plate.sum() <= LARGEST * plate.size and clip.moves(around & inside) >= RING
    return cv2.dilate(plate, np.ones((3, 3), np.uint8)) if is_sure else None


def _box(plate: Bytes) -> tuple[int, int, int, int]:
    """First column and row of a plate, and those behind its last."""
    x, y, across, down = cv2.boundingRect(plate)
    return x, y, x + across, y + down


def _with_digits(rows: Bytes, edges: Mask, left: int, right: int) -> tuple[int, int]:
    """First column of a line of text, and that behind its last, with the digits that change.

    In every frame they have the colours of the fixed ones, the brightest and the darkest.

    Args:
        rows: (n, h, w) luma of the line in all frames.
        edges: (h, w) fixed pixels.
        left: First column of the fixed ones.
        right: Column behind the last.
    """
    dark, bright = np.percentile(np.median(rows, axis=0)[edges], [10, 90])
    kinds = [rows >= bright - CONTRAST]
    if bright - dark > 2 * CONTRAST:
        kinds.append(rows <= dark + CONTRAST)
    # A digit is less wide than high.
    digit = np.ones((1, rows.shape[1]), np.float32) / rows.shape[1]
    shares = [cv2.filter2D(kind.mean(axis=1, dtype=np.float32), -1, digit) for kind in kinds]
    text = np.min(shares, axis=(0, 1)) >= INK
    # The window ends half a digit inside of the last one.
    while right < len(text) and text[right]:
        right += 1
    while left > 0 and text[left - 1]:
        left -= 1
    return left, right
