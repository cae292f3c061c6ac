"""Colours that a frame does not show, taken from the frames that saw them.

What lies behind a silhouette or past the border is a surface of known depth; where another frame sees it,
inside its picture and not hidden there by anything that this frame shows, its colour is that frame's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, LinearRGBA, Mask
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint, part
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Intrinsics, Reconstruction
from ..depth.view_selection import every_nth, stride
from ..media.clip import to_linear
from ..media.picture_file import Pixels
from .bilateral_grid import BilateralGrid, GridOptions, differ

HiddenColours = Callable[[Floats, Floats], tuple[LinearRGB, Mask]]
"""Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which (n,) are known."""

ROW = 4096
"""Places in a row of a look-up: OpenCV's `remap` takes 32,766 at most."""


@dataclass(frozen=True)
class FillOptions:
    """Which frames are asked for colours, and when they are believed."""

    step: int = 8
    """Every so many-th registered frame is asked, the same ones for frames that follow each other: then
    colours are, too. By `python -m benchmarks.accuracy`: bars have 32.32 dB, with every fourth 32.28."""
    span: int = 32
    """Registered frames before and after, up to which frames are asked. By eye."""
    least_frames: int = 8
    """Frames of a short clip that are asked, even if that needs a smaller step: the shop gains 0.9 dB at 5 m
    (`python -m benchmarks.accuracy.shop_table`)."""
    kept_pictures: int = 12
    """Pictures that are remembered, so that each is read once: those of both sides and four more."""
    longest_side: int = 1920
    """Pixels of the long side of these pictures at most, for memory. By eye."""
    occluder_margin: float = 0.04
    """Of the inverse depth, by which something must be nearer to hide what lies behind. By eye."""
    grid: int = 3
    """Pixels between places of the frame's own surfaces that are projected into the others. By eye."""
    square: int = 6
    """Pixels across the squares of another frame that what is projected there hides: twice `grid`."""
    widest: int = 2
    """Squares at most that something near hides around itself. By eye."""
    beyond: float = 0.1
    """Of the long side, by which the frame's surfaces are taken to go on past its border. By eye."""
    silhouette_margin: float = 1.0
    """Pixels beside something nearer that may show it in part: mixed pixels."""
    gains: tuple[float, float] = (0.5, 2.0)
    """Least and largest ratio of exposures between frames: a stop. By eye."""
    mover_margin: float = 0.004
    """Of the long side, by which what moves is taken to be wider than it was found. By eye."""
    agreement: float = 0.06
    """Difference of colours (square root of linear light) that frames may disagree by. By eye."""
    least_seen: float = 0.5
    """Share of what the frame shows around a place that the others must see as it does, to be believed there.
    By eye; with this test fence gains 0.5 dB (32 px, true depth)."""
    surroundings: GridOptions = field(default_factory=GridOptions)
    """How what the frame shows around a place is remembered."""


class DisocclusionFill:
    """Other frames' colours for the frames of a clip, asked in order."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        moving: Callable[[int], Mask | None] | None = None,
        options: FillOptions = FillOptions(),
    ) -> None:
        """`read` gives a frame's picture as `Footage.read` does.

        `moving` gives (h, w), at any size, what moves by itself in a source frame: its colours are not taken,
        and in the frame that is filled it hides nothing, for elsewhere it stands somewhere else.
        """
        self._rec, self._read, self._moving, self._options = reconstruction, read, moving, options
        self._pictures = LRUCache[LinearRGB](options.kept_pictures)

    def reprojected(
        self, frame: int, canvas: Canvas, picture: LinearRGBA, inverse_depth: Floats
    ) -> ReprojectedColours:
        """What other frames see of what one does not show.

        `picture` (H, W, 4), linear, and `inverse_depth` (H, W) are what the frame itself shows in the canvas.
        UserError where another frame cannot be read.
        """
        options = self._options
        image, _ = self._rec.image_at(frame)
        target = self._target(image.frame, canvas, picture, inverse_depth)
        sources = []
        seen, alike = np.zeros((2, len(target.places)))
        step = stride(self._rec, options.step, options.least_frames)
        others = every_nth(self._rec, frame, step, options.span)
        for number, other in enumerate(others):
            with part(number, len(others)):
                source, colours = self._source_view(image, canvas, other, target)
            sees = np.isfinite(colours[:, 0])
            seen += sees
            alike[sees] += differ(colours[sees], target.colour[sees]) < options.agreement
            sources.append(source)
        surroundings = BilateralGrid.of(
            target.places, target.inverse, target.colour, seen, alike, options.surroundings
        )
        return ReprojectedColours(tuple(sources), surroundings, options)

    def _source_view(
        self, image: Image, canvas: Canvas, other: Image, target: _TargetView
    ) -> tuple[_SourceView, LinearRGB]:
        """What another frame sees, and its colours (n, 3) of the places that the target view shows."""
        lens, options = self._rec.intrinsics(other), self._options
        picture = self._pictures.get(other.frame, lambda: self._linear(other.frame))
        checkpoint(0.5)
        local, xy = _reprojected(image, canvas.pinhole, other, lens, target.places, target.inverse)
        occluders, occluders_xy = _reprojected(
            image, canvas.pinhole, other, lens, target.occluders, target.occluders_inverse
        )
        checkpoint(0.6)
        solid = ~target.moves
        depth = np.concatenate([local[solid, 2], occluders[:, 2]])
        inverse = np.concatenate([target.inverse[solid], target.occluders_inverse])
        apart = options.grid * lens.fx / canvas.pinhole.fx / np.maximum(depth * inverse, 1e-9)
        xy_all = np.concatenate([xy[solid], occluders_xy])
        nearest = _nearest(xy_all, depth, apart, (lens.height, lens.width), options)
        checkpoint(0.8)
        source = _SourceView(
            image, canvas.pinhole, other, lens, self._wide(other.frame), picture, nearest, options
        )
        colours = source.seen(local, xy)
        gain = _gain(target.colour[solid], colours[solid], options.gains)
        return replace(source, gain=gain), colours * gain

    def _target(self, frame: int, canvas: Canvas, picture: LinearRGBA, inverse_depth: Floats) -> _TargetView:
        """What a frame shows, thinned out, of a picture (H, W, 4) and inverse depths (H, W)."""
        options, shape = self._options, inverse_depth.shape
        grid = options.grid
        rows, columns = (np.arange(min(grid // 2, n - 1), n, grid) for n in shape)
        places, at = _centres(rows, columns), np.ix_(rows, columns)
        # Surfaces go on past the border.
        beyond = grid * int(options.beyond * max(shape) / grid)
        rows, columns = (np.arange(grid // 2 - beyond, n + beyond, grid) for n in shape)
        ring = _centres(rows, columns)
        ring = ring[np.any((ring < 0) | (ring > shape[::-1]), axis=1)]
        least = cv2.erode(inverse_depth, np.ones((3, 3), np.uint8))
        silhouettes = np.argwhere(inverse_depth > (1 + options.occluder_margin) * least)[:, ::-1] + 0.5
        occluders = np.concatenate([ring, silhouettes])
        wide, size = self._wide(frame), [canvas.lens.width, canvas.lens.height]
        occluders = occluders[~_within(wide, canvas.features_to_source(occluders) / size)]
        column, row = np.clip(occluders, 0, np.array(shape[::-1]) - 1).astype(int).T
        return _TargetView(
            places, inverse_depth[at].ravel(), picture[at][..., :3].reshape(-1, 3),
            _within(wide, canvas.features_to_source(places) / size), occluders, inverse_depth[row, column],
        )  # fmt: skip

    def _wide(self, frame: int) -> Mask | None:
        """(h, w) what moves by itself in a source frame, and a little more."""
        mask = self._moving(frame) if self._moving else None
        if mask is None or not mask.any():
            return None
        around = 2 * int(np.ceil(self._options.mover_margin * max(mask.shape))) + 1
        return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((around, around))) > 0)

    def _linear(self, frame: int) -> LinearRGB:
        """(h, w, 3) a source frame's picture in linear light."""
        checkpoint()
        picture = to_linear(self._read(frame))[..., :3]
        checkpoint()
        zoom = self._options.longest_side / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return np.asarray(picture, np.float32)


@dataclass(frozen=True)
class ReprojectedColours:
    """What other frames see of what one does not show."""

    sources: tuple[_SourceView, ...]
    """The frames that are asked."""
    surroundings: BilateralGrid
    """What the frame itself shows, and how often the others see the same."""
    options: FillOptions
    """When the others are believed."""

    def colours(self, places: Floats, inverse: Floats) -> tuple[LinearRGB, Mask]:
        """Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which (n,) are
        known: a `HiddenColours`.

        The median of the frames that see a place, if half of them agree with it: what moved away disagrees.
        Nothing is known where the frames do not even see what the frame itself shows around at that depth,
        nor by a single one whose colour is unlike all of that: something may have passed there.
        """
        if not (len(places) and self.sources):
            return np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        found = []
        for source in self.sources:
            checkpoint()
            found.append(source.colours(places, inverse))
        colours = np.stack(found)
        known = np.isfinite(colours[..., 0]).sum(axis=0)
        colours[:, known == 0] = 0
        checkpoint()
        middle = _median(colours, np.maximum(known, 1))
        checkpoint()
        with np.errstate(invalid="ignore"):
            agree = (differ(colours, middle) < self.options.agreement).sum(axis=0)
        around = self.surroundings
        sound = (
            (known > 0) & (2 * agree >= known) & (around.alike(places, inverse) >= self.options.least_seen)
        )
        return middle, sound & ((known > 1) | around.shows(places, inverse, middle))


@dataclass(frozen=True)
class _TargetView:
    """What the frame that is filled shows itself, thinned out."""

    places: Floats
    """(n, 2) canvas pixels, every `FillOptions.grid` of them."""
    inverse: Floats
    """(n,) inverse depth of the places, 1 / scene units."""
    colour: LinearRGB
    """(n, 3) linear colour of the places."""
    moves: Mask
    """(n,) whether a place moves by itself."""
    occluders: Floats
    """(m, 2) more places that may hide something elsewhere: past the border, and beside something farther."""
    occluders_inverse: Floats
    """(m,) inverse depth of those occluders, 1 / scene units."""


@dataclass(frozen=True)
class _SourceView:
    """What another frame sees."""

    image: Image
    """Pose of the frame that is filled."""
    pinhole: Intrinsics
    """Canvas of the frame that is filled."""
    other: Image
    """Pose of the source view."""
    lens: Intrinsics
    """Lens of the source view."""
    moving: Mask | None
    """(h, w) what moves by itself in the source view, at any size."""
    picture: LinearRGB
    """(h, w, 3) the source view's picture."""
    nearest: Floats
    """(r, c) inverse depth of what stands before all else, in squares of `FillOptions.square` pixels."""
    options: FillOptions
    """How much nearer something must be to hide a place, and by how far."""
    gain: LinearRGB | float = 1.0
    """(3,) by how much the frame that is filled is brighter."""

    def colours(self, places: Floats, inverse: Floats) -> LinearRGB:
        """(n, 3) linear colours of places (n, 2), canvas pixels, at inverse depths (n,), as bright as the
        frame that is filled; NaN where the source view does not see them."""
        there = _reprojected(self.image, self.pinhole, self.other, self.lens, places, inverse)
        return self.seen(*there) * self.gain

    def seen(self, local: Floats, xy: Floats) -> LinearRGB:
        """(n, 3) its colours, in its own brightness, of places (n, 3) in its space that it has at pixels
        (n, 2); NaN where it does not see them."""
        inside = (local[:, 2] > 0) & np.all((xy >= 0.5) & (xy <= self._limit - 0.5), axis=1)
        place = np.nonzero(inside)[0]
        at, there = xy[place], 1 / local[place, 2]
        margin, square = self.options.silhouette_margin, self.options.square
        squares = [
            ((at + beside).clip(0, self._limit - 1) / square).astype(int).T for beside in (-margin, margin)
        ]
        before = np.maximum.reduce([self.nearest[r[1], c[0]] for r in squares for c in squares])
        occluded = before > (1 + self.options.occluder_margin) * there
        sees = ~occluded & ~_within(self.moving, at / self._limit)
        colours = np.full((len(xy), 3), np.nan, np.float32)
        zoom = np.array(self.picture.shape[1::-1]) / self._limit
        colours[place[sees]] = _sampled(self.picture, at[sees] * zoom)
        return colours

    @property
    def _limit(self) -> Floats:
        """(2,) width and height of the source view in pixels."""
        return np.array([self.lens.width, self.lens.height], np.float64)


def _centres(rows: Indices, columns: Indices) -> Floats:
    """(n, 2) the centres of pixels in rows and columns, row by row."""
    return np.stack(np.meshgrid(columns + 0.5, rows + 0.5), axis=-1).reshape(-1, 2)


def _reprojected(
    image: Image, pinhole: Intrinsics, other: Image, lens: Intrinsics, places: Floats, inverse: Floats
) -> tuple[Floats, Floats]:
    """(n, 3) places in another camera's space, and (n, 2) pixels where it sees them, of a pinhole's pixels
    (n, 2) at inverse depths (n,)."""
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


def _nearest(
    xy: Floats, depth: Floats, apart: Floats, shape: tuple[int, int], options: FillOptions
) -> Floats:
    """(h, w) largest inverse depth of the places (n, 2) in each square of a picture, 0 where none is.

    `apart` (n,) is how many pixels they are apart: then all squares between are theirs.
    """
    square = options.square
    size = np.array([-(-n // square) for n in shape])
    nearest = np.zeros(size)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & np.all((xy >= 0) & (xy < shape[::-1]), axis=1)
    at, inverse = (xy[inside][:, ::-1] / square).astype(int), 1 / depth[inside]
    wide = np.minimum(np.ceil((apart[inside] / square - 1) / 2), options.widest).astype(int)
    for reach in range(int(wide.max(initial=0)) + 1):
        # Squares of the ring so far away.
        far = wide >= reach
        for step in np.argwhere(np.ones((2 * reach + 1,) * 2)) - reach:
            if np.abs(step).max() == reach:
                row, column = np.clip(at[far] + step, 0, size - 1).T
                np.maximum.at(nearest, (row, column), inverse[far])
    return nearest


def _sampled(picture: LinearRGB, xy: Floats) -> LinearRGB:
    """(n, 3) colours at pixels (n, 2)."""
    if not len(xy):
        return np.zeros((0, 3), np.float32)
    # OpenCV looks up at most 32,766 places in a row.
    at = np.full((-(-len(xy) // ROW) * ROW, 2), -9, np.float32)
    at[: len(xy)] = xy - 0.5
    x, y = at.T.reshape(2, -1, ROW)
    found = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(-1, 3)[: len(xy)], np.float32)


def _gain(own: LinearRGB, theirs: LinearRGB, bounds: tuple[float, float]) -> LinearRGB:
    """(3,) by how much the frame is brighter than another, of colours (n, 3) of the same places; NaN where
    the other does not see them."""
    good = (own > 0.02).all(axis=1) & (own < 0.9).all(axis=1) & (theirs > 0.02).all(axis=1)
    if good.sum() < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[good] / theirs[good], axis=0), *bounds), np.float32)


def _median(colours: LinearRGB, known: Indices) -> LinearRGB:
    """(n, 3) of the first axis of colours (k, n, 3), of which so many (n,) are not NaN."""
    ordered = np.sort(colours, axis=0)
    places = np.arange(colours.shape[1])
    low, high = (ordered[(known - odd) // 2, places] for odd in (1, 0))
    return np.asarray((low + high) / 2, np.float32)
