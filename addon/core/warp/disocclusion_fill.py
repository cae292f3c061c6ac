"""Colours that a frame does not show, taken from the frames that saw them.

What lies behind a silhouette or past the border is a surface of known depth; where another frame sees it,
inside its picture and not hidden there by anything that this frame shows, its colour is that frame's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint, part
from ..camera.canvas import Canvas, Picture
from ..camera.reconstruction import Floats, Image, Intrinsics, Reconstruction
from ..depth.view_selection import every_nth, stride
from ..media.clip import to_linear
from ..media.picture_file import Pixels
from .bilateral_grid import BilateralGrid, differ

Mask = NDArray[np.bool_]
HiddenColours = Callable[[Floats, Floats], tuple[Picture, Mask]]
"""Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which are known."""

STEP, SPAN = 8, 32
"""Every eighth registered frame is asked, so far before and after. They are the same for frames that follow
each other: then colours are, too, and pictures are read once."""
KEPT, LONGEST = 12, 1920
"""Pictures that are kept, and their long side in pixels at most."""
NEARER = 0.04
"""Of the inverse depth, by which something must be nearer to hide what lies behind."""
GRID, SQUARE = 3, 6
"""Pixels; the frame's own surfaces are projected into the others so far apart, and hide squares there."""
WIDE = 2
"""Squares at most that something near hides around itself."""
BEYOND = 0.1
"""Of the long side, by which the frame's surfaces are taken to go on past its border."""
RIM = 1.0
"""Pixels beside something nearer that may show it in part."""
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


class DisocclusionFill:
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
        self._pictures = LRUCache[Picture](KEPT)

    def reprojected(
        self, frame: int, canvas: Canvas, picture: Picture, inverse_depth: Floats
    ) -> ReprojectedColours:
        """What other frames can lend to one.

        `picture` (H, W, 4) and `inverse_depth` (H, W) are what the frame itself shows in the canvas.
        """
        image, _ = self._rec.image_at(frame)
        own = self._own(image.frame, canvas, picture, inverse_depth)
        sights = []
        seen, alike = np.zeros((2, len(own.places)))
        others = every_nth(self._rec, frame, stride(self._rec, STEP, 8), SPAN)
        for number, other in enumerate(others):
            with part(number, len(others)):
                sight, colours = self._sight(image, canvas, other, own)
            sees = np.isfinite(colours[:, 0])
            seen += sees
            alike[sees] += differ(colours[sees], own.colour[sees]) < AGREE
            sights.append(sight)
        return ReprojectedColours(
            tuple(sights), BilateralGrid.of(own.places, own.inverse, own.colour, seen, alike)
        )

    def _sight(self, image: Image, canvas: Canvas, other: Image, own: _Own) -> tuple[_SourceView, Picture]:
        """What another frame sees, and its colours (n, 3) of the frame's own places."""
        lens = self._rec.intrinsics(other)
        picture = self._pictures.get(other.frame, lambda: self._linear(other.frame))
        checkpoint(0.5)
        local, xy = _moved(image, canvas.pinhole, other, lens, own.places, own.inverse)
        before, before_xy = _moved(image, canvas.pinhole, other, lens, own.before, own.before_inverse)
        checkpoint(0.6)
        solid = ~own.moves
        depth = np.concatenate([local[solid, 2], before[:, 2]])
        inverse = np.concatenate([own.inverse[solid], own.before_inverse])
        apart = GRID * lens.fx / canvas.pinhole.fx / np.maximum(depth * inverse, 1e-9)
        xy_before = np.concatenate([xy[solid], before_xy])
        nearest = _nearest(xy_before, depth, apart, (lens.height, lens.width))
        checkpoint(0.8)
        sight = _SourceView(image, canvas.pinhole, other, lens, self._wide(other.frame), picture, nearest)
        colours = sight.seen(local, xy)
        gain = _gain(own.colour[solid], colours[solid])
        return replace(sight, gain=gain), colours * gain

    def _own(self, frame: int, canvas: Canvas, picture: Picture, inverse_depth: Floats) -> _Own:
        """What a frame shows, thinned out."""
        shape = inverse_depth.shape
        rows, columns = (np.arange(min(GRID // 2, n - 1), n, GRID) for n in shape)
        places, at = _grid(rows, columns), np.ix_(rows, columns)
        # Surfaces go on past the border.
        beyond = GRID * int(BEYOND * max(shape) / GRID)
        rows, columns = (np.arange(GRID // 2 - beyond, n + beyond, GRID) for n in shape)
        ring = _grid(rows, columns)
        ring = ring[np.any((ring < 0) | (ring > shape[::-1]), axis=1)]
        least = cv2.erode(inverse_depth, np.ones((3, 3), np.uint8))
        rim = np.argwhere(inverse_depth > (1 + NEARER) * least)[:, ::-1] + 0.5
        before = np.concatenate([ring, rim])
        wide, size = self._wide(frame), [canvas.lens.width, canvas.lens.height]
        before = before[~_within(wide, canvas.features_to_source(before) / size)]
        column, row = np.clip(before, 0, np.array(shape[::-1]) - 1).astype(int).T
        return _Own(
            places, inverse_depth[at].ravel(), picture[at][..., :3].reshape(-1, 3),
            _within(wide, canvas.features_to_source(places) / size), before, inverse_depth[row, column],
        )  # fmt: skip

    def _wide(self, frame: int) -> Mask | None:
        """(h, w) what moves by itself in a source frame, and a little more."""
        mask = self._moving(frame) if self._moving else None
        if mask is None or not mask.any():
            return None
        around = 2 * int(np.ceil(AROUND * max(mask.shape))) + 1
        return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((around, around))) > 0)

    def _linear(self, frame: int) -> Picture:
        """(h, w, 3)."""
        checkpoint()
        picture = to_linear(self._read(frame))[..., :3]
        checkpoint()
        zoom = LONGEST / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return np.asarray(picture, np.float32)


@dataclass(frozen=True)
class ReprojectedColours:
    """What other frames see of what one does not show."""

    sights: tuple[_SourceView, ...]
    around: BilateralGrid

    def colours(self, places: Floats, inverse: Floats) -> tuple[Picture, Mask]:
        """What is `HiddenColours`.

        The median of the frames that see a place, if half of them agree with it: what moved away disagrees.
        Nothing is known where the frames do not even see what the frame itself shows around at that depth,
        nor by a single one whose colour is unlike all of that: something may have passed there.
        """
        if not (len(places) and self.sights):
            return np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        found = []
        for sight in self.sights:
            checkpoint()
            found.append(sight.colours(places, inverse))
        colours = np.stack(found)
        known = np.isfinite(colours[..., 0]).sum(axis=0)
        colours[:, known == 0] = 0
        checkpoint()
        middle = _median(colours, np.maximum(known, 1))
        checkpoint()
        with np.errstate(invalid="ignore"):
            agree = (differ(colours, middle) < AGREE).sum(axis=0)
        sound = (known > 0) & (2 * agree >= known) & (self.around.alike(places, inverse) >= TRUSTED)
        return middle, sound & ((known > 1) | self.around.shows(places, inverse, middle))


@dataclass(frozen=True)
class _Own:
    """What the frame itself shows, thinned out."""

    places: Floats
    """(n, 2) every `GRID` pixels,"""
    inverse: Floats
    colour: Picture
    moves: Mask
    """and which of it moves by itself."""
    before: Floats
    """(m, 2) more places that may hide something elsewhere: past the border, and beside something farther."""
    before_inverse: Floats


@dataclass(frozen=True)
class _SourceView:
    """What another frame sees."""

    image: Image
    pinhole: Intrinsics
    other: Image
    lens: Intrinsics
    moving: Mask | None
    """(h, w) what moves by itself in it, at any size."""
    picture: Picture
    """(h, w, 3) linear."""
    nearest: Floats
    """(r, c) inverse depth of what stands before everything else, in squares of `SQUARE` pixels."""
    gain: Picture | float = 1.0
    """By how much (3,) the frame is brighter."""

    def colours(self, places: Floats, inverse: Floats) -> Picture:
        """(n, 3), NaN where it does not see the places."""
        there = _moved(self.image, self.pinhole, self.other, self.lens, places, inverse)
        return self.seen(*there) * self.gain

    def seen(self, local: Floats, xy: Floats) -> Picture:
        """(n, 3) its colours, in its own brightness, of places (n, 3) in its space that it has at pixels
        (n, 2); NaN where it does not see them."""
        inside = (local[:, 2] > 0) & np.all((xy >= 0.5) & (xy <= self._limit - 0.5), axis=1)
        place = np.nonzero(inside)[0]
        at, there = xy[place], 1 / local[place, 2]
        squares = [((at + beside).clip(0, self._limit - 1) / SQUARE).astype(int).T for beside in (-RIM, RIM)]
        before = np.maximum.reduce([self.nearest[r[1], c[0]] for r in squares for c in squares])
        sees = (before <= (1 + NEARER) * there) & ~_within(self.moving, at / self._limit)
        colours = np.full((len(xy), 3), np.nan, np.float32)
        zoom = np.array(self.picture.shape[1::-1]) / self._limit
        colours[place[sees]] = _sampled(self.picture, at[sees] * zoom)
        return colours

    @property
    def _limit(self) -> Floats:
        return np.array([self.lens.width, self.lens.height], np.float64)


def _grid(rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Floats:
    """(n, 2) the middles of pixels, row by row."""
    return np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 2)


def _moved(
    image: Image, pinhole: Intrinsics, other: Image, lens: Intrinsics, places: Floats, inverse: Floats
) -> tuple[Floats, Floats]:
    """(n, 3) places in another camera's space, and (n, 2) pixels where it sees them."""
    rays = np.column_stack([(places - pinhole.principal_point) / pinhole.focal, np.ones(len(places))])
    local = rays / np.maximum(inverse, 1e-9)[:, None]
    there = other.to_camera((local - image.translation) @ image.rotation)
    return there, lens.project(there)


def _within(mask: Mask | None, share: Floats) -> Mask:
    """(n,) whether places at shares (n, 2) of its width and height are in a mask (h, w)."""
    if mask is None:
        return np.zeros(len(share), bool)
    limit = np.array(mask.shape[::-1])
    column, row = np.clip(np.nan_to_num(share) * limit, 0, limit - 1).astype(int).T
    return np.asarray(mask[row, column])


def _nearest(xy: Floats, depth: Floats, apart: Floats, shape: tuple[int, int]) -> Floats:
    """(h, w) largest inverse depth of the places (n, 2) in each square of a picture, 0 where none is.

    `apart` (n,) is how many pixels they are apart: then all squares between are theirs.
    """
    size = np.array([-(-n // SQUARE) for n in shape])
    nearest = np.zeros(size)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & np.all((xy >= 0) & (xy < shape[::-1]), axis=1)
    at, inverse = (xy[inside][:, ::-1] / SQUARE).astype(int), 1 / depth[inside]
    wide = np.minimum(np.ceil((apart[inside] / SQUARE - 1) / 2), WIDE).astype(int)
    for reach in range(int(wide.max(initial=0)) + 1):
        # Squares of the ring so far away.
        far = wide >= reach
        for step in np.argwhere(np.ones((2 * reach + 1,) * 2)) - reach:
            if np.abs(step).max() == reach:
                row, column = np.clip(at[far] + step, 0, size - 1).T
                np.maximum.at(nearest, (row, column), inverse[far])
    return nearest


def _sampled(picture: Picture, xy: Floats) -> Picture:
    """(n, 3) colours at pixels (n, 2)."""
    if not len(xy):
        return np.zeros((0, 3), np.float32)
    # OpenCV looks up at most 32,766 places in a row.
    at = np.full((-(-len(xy) // ROW) * ROW, 2), -9, np.float32)
    at[: len(xy)] = xy - 0.5
    x, y = at.T.reshape(2, -1, ROW)
    found = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(xy)], np.float32)


def _gain(own: Picture, theirs: Picture) -> Picture:
    """(3,) by how much the frame is brighter than another, of colours (n, 3) of the same places; NaN where
    the other does not see them."""
    good = (own > 0.02).all(axis=1) & (own < 0.9).all(axis=1) & (theirs > 0.02).all(axis=1)
    if good.sum() < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[good] / theirs[good], axis=0), *GAINS), np.float32)


def _median(colours: Picture, known: NDArray[np.intp]) -> Picture:
    """(n, 3) of the first axis of colours (k, n, 3), of which so many (n,) are not NaN."""
    ordered = np.sort(colours, axis=0)
    places = np.arange(colours.shape[1])
    low, high = (ordered[(known - odd) // 2, places] for odd in (1, 0))
    return np.asarray((low + high) / 2, np.float32)
