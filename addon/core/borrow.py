"""Colours that a frame does not show, taken from the frames that saw them.

What lies behind a silhouette or past the border is a surface of known depth; where another frame sees it,
inside its picture and not hidden there by anything that this frame shows, its colour is that frame's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .canvas import Canvas, Picture
from .dense_neighbours import regular
from .footage import Pixels, to_linear
from .recent import Recent
from .reconstruction import Floats, Image, Intrinsics, Reconstruction

Mask = NDArray[np.bool_]

STEP, SPAN, FEWEST = 8, 32, 8
"""Every eighth registered frame is asked, so far before and after; of a short clip, so many at least. They
are the same for frames that follow each other: then colours are, too, and pictures are read once."""
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

    def colours(
        self,
        frame: int,
        canvas: Canvas,
        picture: Picture,
        inverse_depth: Floats,
        places: Floats,
        inverse: Floats,
    ) -> tuple[Picture, Mask]:
        """Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which are known.

        `picture` (H, W, 4) and `inverse_depth` (H, W) are what the frame itself shows in the canvas. The
        median of the frames that see a place, if half of them agree with it: what moved away disagrees.
        """
        image, _ = self._rec.image_at(frame)
        if not len(places):
            return np.zeros((0, 3), np.float32), np.zeros(0, bool)
        own = self._grid(image.frame, canvas, picture, inverse_depth)
        said = [self._seen(image, canvas, other, own, places, inverse) for other in self._others(frame)]
        if not said:
            return np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        colours = np.stack(said)
        known = np.isfinite(colours[..., 0]).sum(axis=0)
        colours[:, known == 0] = 0
        middle: Picture = np.nanmedian(colours, axis=0)
        with np.errstate(invalid="ignore"):
            off = np.abs(np.sqrt(np.maximum(colours, 0)) - np.sqrt(np.maximum(middle, 0))).max(axis=2)
            agree = (off < AGREE).sum(axis=0)
        return middle.astype(np.float32), (known > 0) & (2 * agree >= known)

    def _others(self, frame: int) -> list[Image]:
        step = max(1, min(STEP, len(self._rec.images) // FEWEST))
        return regular(self._rec, frame, step, SPAN)

    def _seen(
        self, image: Image, canvas: Canvas, other: Image, own: _Own, places: Floats, inverse: Floats
    ) -> Picture:
        """(n, 3) colours, NaN where the other frame does not see the places."""
        lens = self._rec.intrinsics(other)
        local, xy = _moved(image, canvas.pinhole, other, lens, places, inverse)
        own_local, own_xy = _moved(image, canvas.pinhole, other, lens, own.places, own.inverse)
        nearest = _nearest(own_xy, own_local[:, 2], (lens.height, lens.width), own.step)
        with np.errstate(divide="ignore", invalid="ignore"):
            there = 1 / local[:, 2]
        limit = np.array([lens.width, lens.height])
        column, row = (np.nan_to_num(xy).clip(0, limit - 1) / own.step).astype(int).T
        seen = (local[:, 2] > 0) & np.all((xy >= 0.5) & (xy <= limit - 0.5), axis=1)
        seen &= nearest[row, column] <= (1 + NEARER) * there
        seen &= ~self._moves(other.frame, xy / limit)
        picture = self._picture(other)
        zoom = np.array(picture.shape[1::-1]) / limit
        both = (own_local[:, 2] > 0) & ~self._moves(other.frame, own_xy / limit)
        gain = _gain(own.colour, _sampled(picture, own_xy * zoom), both)
        colour = _sampled(picture, xy * zoom) * gain
        colour[~seen] = np.nan
        return colour

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

    def _picture(self, image: Image) -> Picture:
        """(h, w, 3) linear."""
        return self._pictures.get(image.frame, lambda: self._linear(image.frame)).astype(np.float32)

    def _linear(self, frame: int) -> NDArray[np.float16]:
        picture = to_linear(self._read(frame))[..., :3]
        zoom = LONGEST / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return picture.astype(np.float16)


@dataclass(frozen=True)
class _Own:
    """The frame's own surfaces that stand still, thinned out."""

    places: Floats
    inverse: Floats
    colour: Picture
    step: int


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


def _sampled(picture: Picture, xy: Floats) -> Picture:
    """(n, 3) colours at pixels (n, 2)."""
    # OpenCV looks up at most 32,766 places in a row.
    at = np.full((-(-len(xy) // ROW) * ROW, 2), -9, np.float32)
    at[: len(xy)] = np.nan_to_num(xy - 0.5, nan=-9).clip(-9, max(picture.shape) + 9)
    x, y = at.T.reshape(2, -1, ROW)
    found = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(xy)], np.float32)


def _gain(own: Picture, theirs: Picture, both: Mask) -> Picture:
    """(3,) by how much the frame is brighter than another, of what both see."""
    good = both & (own > 0.02).all(axis=1) & (own < 0.9).all(axis=1) & (theirs > 0.02).all(axis=1)
    if good.sum() < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[good] / theirs[good], axis=0), *GAINS), np.float32)
