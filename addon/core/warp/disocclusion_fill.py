"""Colours of hidden pixels from other frames.

The surface behind a silhouette or past the border has a known depth; another frame that sees it, inside its
picture and not hidden by anything in this frame, gives its colour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..base.arrays import Floats, Indices, LinearRGB, LinearRGBA, Map, Mask
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint, part
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Intrinsics, Reconstruction
from ..depth.source import extended
from ..depth.view_selection import every_nth, stride
from ..media.clip import to_linear
from ..media.picture_file import Pixels
from .bilateral_grid import BilateralGrid
from .source_view import CHUNK, Places, Reprojection, SourceView

HiddenColours = Callable[[Floats, Floats], tuple[LinearRGB, Mask]]
"""Linear colours (n, 3) of places (n, 2), canvas pixels, at inverse depths (n,), and which (n,) are known."""

GAIN_PLACES = 20_000
"""Places, evenly chosen, of which exposures are compared: with ratios that spread by a tenth, their median is
right to a thousandth."""
STEP = 8
"""Every so many-th registered frame is a source, the same ones for frames that follow each other: then
colours are, too. By `python -m benchmarks.accuracy`: bars have 32.32 dB, with every fourth 32.28."""
SPAN = 32
"""Registered frames before and after, up to which frames are sources. Chosen by inspection."""
LEAST_FRAMES = 8
"""Frames of a short clip that are sources, even if that needs a smaller step: the shop gains 0.9 dB at 5
m (`python -m benchmarks.accuracy.shop_table`)."""
KEPT_PICTURES = 12
"""Pictures that are remembered, so that each is read once: those of both sides and four more."""
LONGEST_SIDE = 1920
"""Pixels of the long side of these pictures at most, for memory. Chosen by inspection."""
OCCLUDER_MARGIN = 0.04
"""Relative difference of inverse depth from which a surface hides another. Chosen by inspection."""
GRID = 3
"""Pixels between places of the frame's own surfaces that are projected into the others. Chosen by
inspection."""
SQUARE = 6
"""Pixels across the squares of another frame that what is projected there hides: twice `GRID`."""
WIDEST = 2
"""Squares at most that something near hides around itself. Chosen by inspection."""
BEYOND = 0.1
"""Share of the long side by which the frame's surfaces continue past its border. Chosen by inspection."""
SILHOUETTE_MARGIN = 1.0
"""Pixels beside something nearer that may show it in part: mixed pixels."""
GAINS = (0.5, 2.0)
"""Least and largest ratio of exposures between frames: a stop. Chosen by inspection."""
MOVING_MARGIN = 0.004
"""Share of the long side by which moving pixels are dilated. Chosen by inspection."""
AGREEMENT = 0.06
"""Difference of colours (square root of linear light) that frames may disagree by. Chosen by inspection."""
LEAST_SEEN = 0.5
"""Share of the colours around a place that other frames must confirm, to be used there. Chosen by inspection;
with this test fence gains 0.5 dB (32 px, true depth)."""


class DisocclusionFill:
    """Other frames' colours for the frames of a clip, which come in order."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        moving: Callable[[int], Mask | None] | None = None,
    ) -> None:
        """`read` gives a frame's picture as `Footage.read` does.

        `moving` gives (h, w), at any size, what moves by itself in a source frame: its colours are not taken,
        and in the frame that is filled it hides nothing, for elsewhere it stands somewhere else.
        """
        self._rec, self._read, self._moving = reconstruction, read, moving
        self._pictures = LRUCache[LinearRGB](KEPT_PICTURES)

    def reprojected(
        self,
        frame: int,
        canvas: Canvas,
        picture: LinearRGBA,
        inverse_depth: Floats,
        moving: Mask | None = None,
        past_border: Map | None = None,
    ) -> ReprojectedColours:
        """Return other frames' colours for a frame's hidden pixels.

        Args:
            frame: Number of the frame.
            canvas: That of the frame.
            picture: (H, W, 4) linear, shown by the canvas.
            inverse_depth: (H, W).
            moving: (h, w) moving pixels at any size, if they are known.
            past_border: (H + 2 m, W + 2 m) as `PixelDepth.past_border`.

        Raises:
            UserError: Another frame cannot be read.
        """
        image, _ = self._rec.image_at(frame)
        target = self._target(image.frame, canvas, picture, inverse_depth, moving, past_border)
        sources = []
        seen, alike = np.zeros((2, len(target.places)), np.float32)
        step = stride(self._rec, STEP, LEAST_FRAMES)
        others = every_nth(self._rec, frame, step, SPAN)
        for number, other in enumerate(others):
            with part(number, len(others)):
                source, colours = self._source_view(image, canvas, other, target)
            seen += np.isfinite(colours[0])
            alike += _differ(np.sqrt(colours), target.root) < AGREEMENT
            sources.append(source)
        surroundings = BilateralGrid.of(target.places, target.root, seen, alike)
        return ReprojectedColours(tuple(sources), surroundings)

    def _source_view(
        self, image: Image, canvas: Canvas, other: Image, target: _TargetView
    ) -> tuple[SourceView, Map]:
        """The view of another frame, and its colours (3, n) of the target's places, infinite where unseen."""
        camera = self._rec.intrinsics(other)
        picture = self._pictures.get(other.frame, lambda: self._linear(other.frame))
        checkpoint(0.5)
        reprojection = Reprojection.between(image, canvas.pinhole, other, camera)
        apart = GRID * camera.fx / canvas.pinhole.fx
        nearest = _nearest(reprojection, target.occluders, apart)
        checkpoint(0.7)
        hides = _hides(nearest, self._wide(other.frame), camera)
        source = SourceView(other.frame, reprojection, picture, hides, np.ones(3, np.float32))
        colours = np.concatenate([source.colours(some) for some in _parts(target.places)], axis=1)
        checkpoint(0.8)
        gain = _gain(target.colour[:, target.still], colours[:, target.still], GAINS)
        return replace(source, gain=gain), colours * gain[:, None]

    def _target(
        self,
        frame: int,
        canvas: Canvas,
        picture: LinearRGBA,
        inverse_depth: Floats,
        moving: Mask | None,
        past_border: Map | None,
    ) -> _TargetView:
        """The sparse places of a frame, of a picture (H, W, 4) and inverse depths (H, W).

        `moving` (h, w) are moving pixels, None if they must be found; `past_border` (H + 2 m, W + 2 m) is
        known around the frame.
        """
        shape = inverse_depth.shape
        grid = GRID
        rows, columns = (np.arange(min(grid // 2, n - 1), n, grid) for n in shape)
        at = np.ix_(rows, columns)
        y, x = np.meshgrid(rows, columns, indexing="ij")
        # Surfaces go on past the border.
        beyond = grid * int(BEYOND * max(shape) / grid)
        inverse = extended(inverse_depth, past_border, beyond)
        around = [np.arange(grid // 2 - beyond, n + beyond, grid) for n in shape]
        ring_y, ring_x = (part.ravel() for part in np.meshgrid(*around, indexing="ij"))
        past = (ring_y < 0) | (ring_y >= shape[0]) | (ring_x < 0) | (ring_x >= shape[1])
        least = cv2.erode(inverse, np.ones((3, 3), np.uint8))
        edge_y, edge_x = np.nonzero(inverse > np.float32(1 + OCCLUDER_MARGIN) * least)
        y, x = (
            np.concatenate(part)
            for part in (
                (y.ravel(), ring_y[past], edge_y - beyond), (x.ravel(), ring_x[past], edge_x - beyond)
            )
        )  # fmt: skip
        shown = inverse[y + beyond, x + beyond]
        everything = Places(x.astype(np.float32) + 0.5, y.astype(np.float32) + 0.5, shown)
        still = ~self._moves(frame, canvas, everything, moving)
        count = len(rows) * len(columns)
        colour = np.ascontiguousarray(picture[at][..., :3].reshape(-1, 3).T)
        return _TargetView(
            everything.among(slice(count)), colour, np.sqrt(np.maximum(colour, 0)), still[:count],
            everything.among(still),
        )  # fmt: skip

    def _moves(self, frame: int, canvas: Canvas, places: Places, moving: Mask | None) -> Mask:
        """(n,) whether places of a frame's canvas move, by `moving` (h, w), or None if it must be found."""
        if moving is not None:
            size = canvas.pinhole.width, canvas.pinhole.height
            return _within(self._widened(moving), np.stack([places.x, places.y], axis=1) / size)
        wide = self._wide(frame)
        if wide is None:
            return np.zeros(len(places), bool)
        size = canvas.camera.width, canvas.camera.height
        return _within(wide, canvas.features_to_source(np.stack([places.x, places.y], axis=1)) / size)

    def _wide(self, frame: int) -> Mask | None:
        """(h, w) what moves by itself in a source frame, and a little more."""
        return self._widened(self._moving(frame) if self._moving else None)

    def _widened(self, mask: Mask | None) -> Mask | None:
        """A mask (h, w) and a little more; None where nothing is in it."""
        if mask is None or not mask.any():
            return None
        around = 2 * int(np.ceil(MOVING_MARGIN * max(mask.shape))) + 1
        return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((around, around))) > 0)

    def _linear(self, frame: int) -> LinearRGB:
        """(h, w, 3) a source frame's picture in linear light."""
        checkpoint()
        picture = to_linear(self._read(frame))[..., :3]
        checkpoint()
        zoom = LONGEST_SIDE / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(np.maximum(picture, 0), np.float32)


@dataclass(frozen=True)
class ReprojectedColours:
    """Other frames' colours for a frame's hidden pixels."""

    sources: tuple[SourceView, ...]
    """The source frames."""
    surroundings: BilateralGrid
    """Colours of the frame itself, and how often other frames confirm them."""

    def colours(self, places: Floats, inverse: Floats) -> tuple[LinearRGB, Mask]:
        """Return colours for places of the canvas: a `HiddenColours`.

        The result is the median of the frames that see a place, if half of them agree: moving objects do not.
        There is none where other frames do not confirm the frame's own colours around a place at that depth.
        A single frame must have a colour like those around, as something may have passed.

        Args:
            places: (n, 2) canvas pixels.
            inverse: (n,) inverse depths.

        Returns:
            Linear colours (n, 3), and the places (n,) with one.
        """
        colours, known = np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        if not self.sources:
            return colours, known
        wanted = Places.of(places, inverse)
        for first in range(0, len(places), CHUNK):
            checkpoint()
            some = slice(first, first + CHUNK)
            colours[some], known[some] = self._consensus(wanted.among(some))
        return colours, known

    def _consensus(self, places: Places) -> tuple[LinearRGB, Mask]:
        """Colours (n, 3) of some places, and which (n,) are known."""
        found = [source.colours(places) for source in self.sources]
        known = np.sum([np.isfinite(colour[0]) for colour in found], axis=0)
        middle = _median(found, known)
        root = np.sqrt(middle.T)
        agree = np.sum([_differ(np.sqrt(one), root) < AGREEMENT for one in found], axis=0)
        around = self.surroundings
        sound = (known > 0) & (2 * agree >= known)
        supported = np.flatnonzero(sound)
        cells = around.cells(places.among(supported))
        sound[supported] = around.alike(cells) >= LEAST_SEEN
        # One frame alone has nobody to agree with.
        single = known[supported] == 1
        alone = supported[single]
        sound[alone] &= around.shows(places.among(alone), cells[single], root[:, alone])
        return middle, sound


@dataclass(frozen=True)
class _TargetView:
    """The sparse places of the frame to fill."""

    places: Places
    """Every `GRID` pixels of the canvas."""
    colour: Map
    """(3, n) linear colour of the places."""
    root: Map
    """(3, n) square root of the colours."""
    still: Mask
    """(n,) whether a place does not move by itself."""
    occluders: Places
    """Possible occluders: static places, those past the border, and those beside something farther."""


def _parts(places: Places) -> list[Places]:
    """Places in chunks."""
    return [places.among(slice(first, first + CHUNK)) for first in range(0, len(places), CHUNK)]


def _within(mask: Mask | None, share: Floats) -> Mask:
    """(n,) whether places at shares (n, 2) of its width and height are in a mask (h, w)."""
    if mask is None:
        return np.zeros(len(share), bool)
    limit = np.array(mask.shape[::-1])
    column, row = np.clip(np.nan_to_num(share) * limit, 0, limit - 1).astype(int).T
    return np.asarray(mask[row, column])


def _nearest(reprojection: Reprojection, places: Places, apart: float) -> Map:
    """(r, c) largest inverse depth of the places in each square of the other picture, 0 where none is.

    `apart` is how many pixels of the other picture they are apart if they are as far from it: then all
    squares between are theirs.
    """
    square, camera = SQUARE, reprojection.camera
    size = -(-camera.height // square), -(-camera.width // square)
    nearest = np.zeros(size, np.float32)
    x, y, ratio = reprojection(places)
    inside = np.flatnonzero((x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height))
    x, y, ratio = x[inside], y[inside], ratio[inside]
    at = (y / square).astype(np.int32) * size[1] + (x / square).astype(np.int32)
    inverse = places.inverse[inside] / ratio
    wide = np.minimum(np.ceil((apart / np.maximum(ratio, 1e-9) / square - 1) / 2), WIDEST)
    for reach in range(WIDEST + 1):
        mine = np.maximum(wide, 0) == reach
        if mine.any():
            of_those = np.zeros(size, np.float32)
            np.maximum.at(of_those.ravel(), at[mine], inverse[mine])
            np.maximum(nearest, cv2.dilate(of_those, np.ones((2 * reach + 1,) * 2)), out=nearest)
    return nearest


def _hides(nearest: Map, moving: Mask | None, camera: Intrinsics) -> Map:
    """(H, W) least unoccluded inverse depth in each pixel of a lens, infinite in moving pixels (h, w).

    `nearest` (r, c) is the nearest inverse depth in squares of pixels.
    """
    square, margin = SQUARE, int(SILHOUETTE_MARGIN)
    whole = cv2.resize(
        nearest / np.float32(1 + OCCLUDER_MARGIN),
        (nearest.shape[1] * square, nearest.shape[0] * square), interpolation=cv2.INTER_NEAREST,
    )[: camera.height, : camera.width]  # fmt: skip
    hides = cv2.dilate(whole, np.ones((2 * margin + 1,) * 2))
    if moving is not None:
        mask = cv2.resize(
            moving.astype(np.uint8), (camera.width, camera.height), interpolation=cv2.INTER_NEAREST
        )
        hides[mask > 0] = np.inf
    return np.asarray(hides, np.float32)


def _differ(a: Map, b: Map) -> Map:
    """(n,) by how much square roots of linear colours (3, n) differ: to the eye."""
    return np.asarray(np.abs(a - b).max(axis=0))


def _gain(own: Map, theirs: Map, bounds: tuple[float, float]) -> Map:
    """(3,) ratio of brightness to another frame's, of colours (3, n) of the same places.

    Colours are infinite where the other frame does not see them.
    """
    thinned = slice(None, None, max(1, own.shape[1] // GAIN_PLACES))
    own, theirs = own[:, thinned], theirs[:, thinned]
    low, high = np.minimum(own, theirs).min(axis=0), own.max(axis=0)
    good = np.flatnonzero((low > 0.02) & (high < 0.9) & np.isfinite(theirs[0]))
    if len(good) < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[:, good] / theirs[:, good], axis=1), *bounds), np.float32)


def _median(colours: list[Map], known: Indices) -> LinearRGB:
    """(n, 3) of colours (3, n) by source, of which so many (n,) are not infinite; 0 where none is.

    Odd-even transposition sort (Habermann 1972): few values in many places are sorted fastest so.
    """
    ordered = list(colours)
    for turn in range(len(ordered)):
        for i in range(turn % 2, len(ordered) - 1, 2):
            a, b = ordered[i], ordered[i + 1]
            ordered[i], ordered[i + 1] = np.minimum(a, b), np.maximum(a, b)
    stack, places = np.stack(ordered), np.arange(len(known))
    low, high = (stack[np.maximum(known - odd, 0) // 2, :, places] for odd in (1, 0))
    low[known == 0] = high[known == 0] = 0
    return np.asarray((low + high) / 2, np.float32)
