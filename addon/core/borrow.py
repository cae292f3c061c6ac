"""Colours that a frame does not show, taken from the frames that saw them.

What lies behind a silhouette or past the border is a surface of known depth; where another frame sees it,
inside its picture and not hidden there by anything that this frame shows, its colour is that frame's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from .canvas import Canvas, Picture
from .dense_neighbours import regular, stride
from .footage import Pixels, to_linear
from .recent import Recent
from .reconstruction import Floats, Image, Intrinsics, Reconstruction

Mask = NDArray[np.bool_]
Lent = Callable[[Floats, Floats], tuple[Picture, Mask]]
"""Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which are known."""

STEP, SPAN = 8, 32
"""Every eighth registered frame is asked, so far before and after. They are the same for frames that follow
each other: then colours are, too, and pictures are read once."""
KEPT, LONGEST = 12, 1920
"""Pictures that are kept, and their long side in pixels at most."""
NEARER = 0.04
"""Of the inverse depth, by which something must be nearer to hide what lies behind."""
GRID = 3
"""Pixels; the frame's own surfaces are projected into the others in squares of this size."""
GAINS = 0.5, 2.0
"""Between which the exposure of another frame may differ."""
ROW = 4096
"""Places that are looked up at once."""
AROUND = 0.004
"""Of the long side, by which what moves is taken to be wider than it was found."""
AGREE = 0.06
"""Difference of colours (square root of linear light) that frames may disagree by about the same place."""
TRUSTED = 0.5
"""Share of what the frame shows around that the others must see as it does, if they are to lend."""
CELLS, DEPTHS, BESIDE = 80, 32, 7
"""What is around: so many cells in a row, so many depths, and so many cells to a side."""


class Lender:
    """Other frames' colours for the frames of a clip, asked in order."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        moving: Callable[[int], Mask | None] | None = None,
    ) -> None:
        """`read` gives a frame's picture as `Footage.read` does.

        `moving` gives (h, w), at any size, what moves by itself in a source frame: that is not lent, and in
        the frame that asks it hides nothing, for elsewhere it stands somewhere else.
        """
        self._rec, self._read, self._moving = reconstruction, read, moving
        self._pictures = Recent[NDArray[np.float16]](KEPT)

    def loan(self, frame: int, canvas: Canvas, picture: Picture, inverse_depth: Floats) -> Loan:
        """What other frames can lend to one.

        `picture` (H, W, 4) and `inverse_depth` (H, W) are what the frame itself shows in the canvas.
        """
        image, _ = self._rec.image_at(frame)
        own = self._grid(image.frame, canvas, picture, inverse_depth)
        sights, seen, alike = [], np.zeros(len(own.places)), np.zeros(len(own.places))
        for other in regular(self._rec, frame, stride(self._rec, STEP), SPAN):
            sight = self._sight(image, canvas, other, own)
            colours = sight.colours(own.places, own.inverse)
            sees = np.isfinite(colours[:, 0])
            seen += sees
            alike[sees] += _differ(colours[sees], own.colour[sees]) < AGREE
            sights.append(sight)
        return Loan(tuple(sights), _Trust.of(own, seen, alike))

    def _sight(self, image: Image, canvas: Canvas, other: Image, own: _Own) -> _Sight:
        lens = self._rec.intrinsics(other)
        local, xy = _moved(image, canvas.pinhole, other, lens, own.places, own.inverse)
        size = np.array([lens.width, lens.height])
        picture = self._pictures.get(other.frame, lambda: self._linear(other.frame))
        both = (local[:, 2] > 0) & ~self._moves(other.frame, xy / size)
        zoom = np.array(picture.shape[1::-1]) / size
        gain = _gain(own.colour, _sampled(picture, xy * zoom), both)
        nearest = _nearest(xy, local[:, 2], (lens.height, lens.width), own.step)
        return _Sight(
            image, canvas.pinhole, other, lens, partial(self._moves, other.frame), picture, gain,
            nearest, own.step,
        )  # fmt: skip

    def _grid(self, frame: int, canvas: Canvas, picture: Picture, inverse_depth: Floats) -> _Own:
        """What stands still of a frame."""
        half = GRID // 2
        rows = np.arange(half, picture.shape[0], GRID)
        columns = np.arange(half, picture.shape[1], GRID)
        places = np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 2)
        at = np.ix_(rows, columns)
        size = [canvas.lens.width, canvas.lens.height]
        still = ~self._moves(frame, canvas.features_to_source(places) / size)
        colour = picture[at][..., :3].reshape(-1, 3)
        return _Own(places[still], inverse_depth[at].ravel()[still], colour[still], 2 * GRID)

    def _moves(self, frame: int, share: Floats) -> Mask:
        """(n,) whether what moves by itself is at shares (n, 2) of a source frame's width and height."""
        mask = self._moving(frame) if self._moving else None
        if mask is None or not mask.any():
            return np.zeros(len(share), bool)
        around = 2 * int(np.ceil(AROUND * max(mask.shape))) + 1
        wide = cv2.dilate(mask.astype(np.uint8), np.ones((around, around)))
        limit = np.array(mask.shape[::-1])
        column, row = np.clip(np.nan_to_num(share) * limit, 0, limit - 1).astype(int).T
        return np.asarray(wide[row, column] > 0)

    def _linear(self, frame: int) -> NDArray[np.float16]:
        """(h, w, 3)."""
        picture = to_linear(self._read(frame))[..., :3]
        zoom = LONGEST / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return picture.astype(np.float16)


@dataclass(frozen=True)
class Loan:
    """What other frames see of what one does not show."""

    sights: tuple[_Sight, ...]
    trust: _Trust

    def colours(self, places: Floats, inverse: Floats) -> tuple[Picture, Mask]:
        """What is `Lent`.

        The median of the frames that see a place, if half of them agree with it: what moved away disagrees.
        Nothing is known where the frames do not even see what the frame itself shows around at that depth.
        """
        if not (len(places) and self.sights):
            return np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        colours = np.stack([sight.colours(places, inverse) for sight in self.sights])
        known = np.isfinite(colours[..., 0]).sum(axis=0)
        colours[:, known == 0] = 0
        middle = _median(colours, np.maximum(known, 1))
        with np.errstate(invalid="ignore"):
            agree = (_differ(colours, middle) < AGREE).sum(axis=0)
        return middle, (known > 0) & (2 * agree >= known) & (self.trust.at(places, inverse) >= TRUSTED)


@dataclass(frozen=True)
class _Trust:
    """How often frames see what they should, by place and depth: a bilateral grid.

    Chen, Paris and Durand, "Real-time edge-aware image processing with the bilateral grid", 2007.
    """

    share: Floats
    """(B, R, C) of depths, rows and columns; 1 where nothing is to be seen."""
    cell: float
    """Pixels."""
    low: float
    """Inverse depth of the first, and their distance."""
    step: float

    @classmethod
    def of(cls, own: _Own, seen: Floats, alike: Floats) -> _Trust:
        """Of places that were seen so many times (n,), and looked alike."""
        if not len(own.places):
            return cls(np.ones((1, 1, 1)), np.inf, 0.0, np.inf)
        low, high = float(own.inverse.min()), float(own.inverse.max())
        wide, tall = own.places.max(axis=0)
        cell = max(wide, tall) / CELLS
        step = max((high - low) / (DEPTHS - 1), 1e-12)
        empty = np.zeros((DEPTHS, int(tall / cell) + 1, int(wide / cell) + 1))
        grid = cls(empty, cell, low, step)
        at = np.ravel_multi_index(grid._cells(own.places, own.inverse), empty.shape)
        sums = []
        for values in (alike, seen):
            total = np.bincount(at, values, empty.size).reshape(empty.shape)
            # To OpenCV, which filters rows and columns, depths are channels.
            total = cv2.blur(np.moveaxis(total, 0, 2), (BESIDE, BESIDE), borderType=cv2.BORDER_CONSTANT)
            deep = np.pad(np.moveaxis(total, 2, 0), ((1, 1), (0, 0), (0, 0)))
            sums.append(deep[:-2] + 2 * deep[1:-1] + deep[2:])
        share = np.where(sums[1] > 1e-6, sums[0] / np.maximum(sums[1], 1e-6), 1)
        return cls(share, cell, low, step)

    def at(self, places: Floats, inverse: Floats) -> Floats:
        """(n,) of places (n, 2) at inverse depths (n,)."""
        return np.asarray(self.share[self._cells(places, inverse)])

    def _cells(self, places: Floats, inverse: Floats) -> tuple[NDArray[np.intp], ...]:
        index = np.column_stack([(inverse - self.low) / self.step + 0.5, places[:, ::-1] / self.cell])
        return tuple(np.clip(index, 0, np.array(self.share.shape) - 1).astype(np.intp).T)


@dataclass(frozen=True)
class _Own:
    """The frame's own surfaces that stand still, thinned out."""

    places: Floats
    inverse: Floats
    colour: Picture
    step: int


@dataclass(frozen=True)
class _Sight:
    """What another frame sees."""

    image: Image
    pinhole: Intrinsics
    other: Image
    lens: Intrinsics
    moves: Callable[[Floats], Mask]
    picture: NDArray[np.float16]
    """(h, w, 3) linear,"""
    gain: Picture
    """and by how much (3,) the frame is brighter."""
    nearest: Floats
    """(r, c) inverse depth of what stands before everything else, in squares of `step` pixels."""
    step: int

    def colours(self, places: Floats, inverse: Floats) -> Picture:
        """(n, 3), NaN where it does not see the places."""
        local, xy = _moved(self.image, self.pinhole, self.other, self.lens, places, inverse)
        with np.errstate(divide="ignore", invalid="ignore"):
            there = 1 / local[:, 2]
        limit = np.array([self.lens.width, self.lens.height])
        column, row = (np.nan_to_num(xy).clip(0, limit - 1) / self.step).astype(int).T
        seen = (local[:, 2] > 0) & np.all((xy >= 0.5) & (xy <= limit - 0.5), axis=1)
        seen &= self.nearest[row, column] <= (1 + NEARER) * there
        seen &= ~self.moves(xy / limit)
        colour = _sampled(self.picture, xy * np.array(self.picture.shape[1::-1]) / limit) * self.gain
        colour[~seen] = np.nan
        return colour


def _moved(
    image: Image, pinhole: Intrinsics, other: Image, lens: Intrinsics, places: Floats, inverse: Floats
) -> tuple[Floats, Floats]:
    """(n, 3) places in another camera's space, and (n, 2) pixels where it sees them."""
    rays = np.column_stack([(places - pinhole.principal_point) / pinhole.focal, np.ones(len(places))])
    local = rays / np.maximum(inverse, 1e-9)[:, None]
    there = other.to_camera((local - image.translation) @ image.rotation)
    return there, lens.project(there)


def _nearest(xy: Floats, depth: Floats, shape: tuple[int, int], step: int) -> Floats:
    """(h, w) largest inverse depth of the places (n, 2) in each square of a picture, 0 where none is."""
    size = -(-shape[0] // step), -(-shape[1] // step)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & np.all((xy >= 0) & (xy < shape[::-1]), axis=1)
    column, row = (xy[inside] / step).astype(int).T
    nearest = np.zeros(size)
    np.maximum.at(nearest, (row, column), 1 / depth[inside])
    return nearest


def _sampled(picture: NDArray[np.float16], xy: Floats) -> Picture:
    """(n, 3) colours at pixels (n, 2)."""
    # OpenCV looks up at most 32,766 places in a row.
    at = np.full((-(-len(xy) // ROW) * ROW, 2), -9, np.float32)
    at[: len(xy)] = np.nan_to_num(xy - 0.5, nan=-9).clip(-9, max(picture.shape) + 9)
    x, y = at.T.reshape(2, -1, ROW)
    found = cv2.remap(picture.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(xy)], np.float32)


def _gain(own: Picture, theirs: Picture, both: Mask) -> Picture:
    """(3,) by how much the frame is brighter than another, of what both see."""
    good = both & (own > 0.02).all(axis=1) & (own < 0.9).all(axis=1) & (theirs > 0.02).all(axis=1)
    if good.sum() < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[good] / theirs[good], axis=0), *GAINS), np.float32)


def _median(colours: Picture, known: NDArray[np.intp]) -> Picture:
    """(n, 3) of the first axis of colours (k, n, 3), of which so many (n,) are not NaN."""
    ordered = np.sort(colours, axis=0)
    places = np.arange(colours.shape[1])
    low, high = (ordered[(known - odd) // 2, places] for odd in (1, 0))
    return np.asarray((low + high) / 2, np.float32)


def _differ(a: Picture, b: Picture) -> Floats:
    """(...) by how much colours (..., 3) differ to the eye: the square roots of linear light."""
    return np.asarray(np.abs(np.sqrt(np.maximum(a, 0)) - np.sqrt(np.maximum(b, 0))).max(axis=-1))
