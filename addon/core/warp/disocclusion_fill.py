"""Disocclusion fill: colours of surfaces that a frame hides, from other frames.

Surfaces behind silhouettes and past the border have a known depth. A frame that sees one, inside its picture
and unoccluded by the surfaces of the filled frame, provides its colour.
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
from ..depth.map_fusion import BEYOND
from ..depth.source import extended
from ..depth.view_selection import SOURCE_SPAN, SOURCE_STEP, source_frames
from ..media.light import to_linear
from ..media.picture_file import Pixels
from .bilateral_grid import BilateralGrid
from .source_view import Places, Reprojection, SourceView

HiddenColours = Callable[[Floats, Floats], tuple[LinearRGB, Mask]]
"""Maps canvas positions (n, 2) at inverse depths (n,) to linear colours (n, 3), and which are known (n,)."""
GAIN_PLACES = 20_000
"""Positions that compare exposures: at a spread of a tenth, their median is accurate to a thousandth."""
KEPT_PICTURES = 2 * SOURCE_SPAN // SOURCE_STEP + 4
"""Pictures kept in memory, so that each is read once: those of both sides and four more."""
LONGEST_SIDE = 1920
"""Longest side of these pictures in pixels: 25 MB each in single precision."""
OCCLUDER_MARGIN = 0.04
"""Relative difference of inverse depth at which a surface occludes another. Chosen by inspection."""
GRID = 3
"""Pixels between projected positions of the frame's own surfaces. Chosen by inspection."""
SQUARE = 2 * GRID
"""Side in pixels of the squares that projected positions occlude."""
WIDEST = 2
"""Most squares around itself that a near position occludes. Chosen by inspection."""
SILHOUETTE_MARGIN = 1.0
"""Width in pixels of mixed pixels beside a nearer surface."""
GAINS = (0.5, 2.0)
"""Bounds of the ratio of exposures between frames: a stop. Chosen by inspection."""
MOVING_MARGIN = 0.004
"""Dilation of the masks of moving objects, as a share of the long side. Chosen by inspection."""
AGREEMENT = 0.06
"""Largest difference of agreeing colours (square root of linear light). Chosen by inspection."""
LEAST_SEEN = 0.5
"""Least agreement around a position. Chosen by inspection; fence gains 0.5 dB by it (32 px, true depth)."""


class DisocclusionFill:
    """Fills the frames of a clip, in order, with colours of other frames."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        moving: Callable[[int], Mask | None] | None = None,
    ) -> None:
        """Take pictures from `read`, without the moving objects in masks (h, w) from `moving`."""
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
        """Project a frame's surfaces into other frames; raises UserError if one cannot be read.

        Args:
            frame: The frame to fill.
            canvas: Its canvas.
            picture: (H, W, 4) linear.
            inverse_depth: (H, W) of the picture.
            moving: (h, w) mask of moving objects, at any size, which occlude nothing; by default the source
                frame's.
            past_border: (H + 2 m, W + 2 m) as `PixelDepth.past_border`.
        """
        image, _ = self._rec.image_at(frame)
        target = self._target(image.frame, canvas, picture, inverse_depth, moving, past_border)
        sources = []
        seen, alike = np.zeros((2, len(target.places)), np.float32)
        others = source_frames(self._rec, frame)
        for number, other in enumerate(others):
            with part(number, len(others)):
                source, colours = self._source_view(image, canvas, other, target)
            seen += np.isfinite(colours[0])
            alike += _differ(np.sqrt(colours), target.root) < AGREEMENT
            sources.append(source)
        return ReprojectedColours(tuple(sources), BilateralGrid.of(target.places, target.root, seen, alike))

    def _source_view(
        self, image: Image, canvas: Canvas, other: Image, target: _TargetView
    ) -> tuple[SourceView, Map]:
        """Return another frame's view, and its colours (3, n) of the target's positions, or infinity."""
        camera = self._rec.intrinsics(other)
        side = min(LONGEST_SIDE, max(canvas.pinhole.width, canvas.pinhole.height))
        picture = self._pictures.get((other.frame, side), lambda: self._linear(other.frame, side))
        checkpoint(0.5)
        reprojection = Reprojection.between(image, canvas.pinhole, other, camera)
        apart = GRID * camera.fx / canvas.pinhole.fx
        nearest = _nearest(reprojection, target.occluders, apart)
        checkpoint(0.7)
        hides = _hides(nearest, self._wide(other.frame), camera)
        source = SourceView(reprojection, picture, hides, np.ones(3, np.float32))
        parts = [source.colours(target.places.among(some)) for some in target.places.chunks()]
        colours = np.concatenate(parts, axis=1)
        checkpoint(0.8)
        gain = _gain(target.colour[:, target.still], colours[:, target.still])
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
        """Sample the surfaces that a frame shows; the arguments are those of `reprojected`."""
        shape = inverse_depth.shape
        rows, columns = (np.arange(min(GRID // 2, n - 1), n, GRID) for n in shape)
        at = np.ix_(rows, columns)
        y, x = np.meshgrid(rows, columns, indexing="ij")
        # Surfaces extend past the border.
        beyond = GRID * int(BEYOND * max(shape) / GRID)
        inverse = extended(inverse_depth, past_border, beyond)
        around = [np.arange(GRID // 2 - beyond, n + beyond, GRID) for n in shape]
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
        """Mark (n,) moving positions of a frame's canvas, by `moving` (h, w) or the source frame's mask."""
        if moving is not None:
            size = canvas.pinhole.width, canvas.pinhole.height
            return _within(self._widened(moving), np.stack([places.x, places.y], axis=1) / size)
        wide = self._wide(frame)
        if wide is None:
            return np.zeros(len(places), bool)
        size = canvas.camera.width, canvas.camera.height
        return _within(wide, canvas.features_to_source(np.stack([places.x, places.y], axis=1)) / size)

    def _wide(self, frame: int) -> Mask | None:
        """Return a source frame's (h, w) mask of moving objects, dilated."""
        return self._widened(self._moving(frame) if self._moving else None)

    def _widened(self, mask: Mask | None) -> Mask | None:
        """Dilate a mask (h, w); returns None if it is empty."""
        if mask is None or not mask.any():
            return None
        around = 2 * int(np.ceil(MOVING_MARGIN * max(mask.shape))) + 1
        return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((around, around))) > 0)

    def _linear(self, frame: int, longest: int) -> LinearRGB:
        """Read a source frame (h, w, 3) in linear light, its sides at most `longest`."""
        checkpoint()
        picture = to_linear(self._read(frame))[..., :3]
        checkpoint()
        zoom = longest / max(picture.shape)
        if zoom < 1:
            picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(np.maximum(picture, 0), np.float32)


@dataclass(frozen=True)
class ReprojectedColours:
    """Colours of other frames for surfaces that a frame hides."""

    sources: tuple[SourceView, ...]
    surroundings: BilateralGrid
    """The frame's own colours, and their agreement with the others."""

    def colours(self, places: Floats, inverse: Floats) -> tuple[LinearRGB, Mask]:
        """Return colours (n, 3) for places (n, 2) of the canvas at inverse depths (n,), and known ones (n,).

        The result is the median of the frames that see a place, if half of them agree: moving objects do not.
        There is none where other frames do not confirm the frame's own colours around a place at that depth.
        A single frame must have a colour like those around, as something may have passed.
        """
        colours, known = np.zeros((len(places), 3), np.float32), np.zeros(len(places), bool)
        if not self.sources:
            return colours, known
        wanted = Places.of(places, inverse)
        for some in wanted.chunks():
            checkpoint()
            colours[some], known[some] = self._consensus(wanted.among(some))
        return colours, known

    def _consensus(self, places: Places) -> tuple[LinearRGB, Mask]:
        """Return colours (n, 3) of some positions, and which (n,) are known."""
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
        # A single frame cannot be compared with others.
        single = known[supported] == 1
        alone = supported[single]
        sound[alone] &= around.shows(places.among(alone), cells[single], root[:, alone])
        return middle, sound


@dataclass(frozen=True)
class _TargetView:
    """Samples of the surfaces of the frame that is filled."""

    places: Places
    """Every `GRID` pixels of the canvas."""
    colour: Map
    """(3, n) linear."""
    root: Map
    """(3, n) square root of `colour`."""
    still: Mask
    """(n,) static positions."""
    occluders: Places
    """Possible occluders in other frames: static positions, those past the border, and depth edges."""


def _within(mask: Mask | None, share: Floats) -> Mask:
    """Look up (n,) positions at shares (n, 2) of width and height in a mask (h, w)."""
    if mask is None:
        return np.zeros(len(share), bool)
    limit = np.array(mask.shape[::-1])
    column, row = np.clip(np.nan_to_num(share) * limit, 0, limit - 1).astype(int).T
    return np.asarray(mask[row, column])


def _nearest(reprojection: Reprojection, places: Places, apart: float) -> Map:
    """Return (r, c) nearest inverse depths in squares of another picture, filled over `apart` pixels."""
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
    """Return (H, W) least inverse depths of unoccluded surfaces, infinite in `moving` (h, w)."""
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
    """Return (n,) differences of square roots of linear colours (3, n), which are about perceptual."""
    return np.asarray(np.abs(a - b).max(axis=0))


def _gain(own: Map, theirs: Map) -> Map:
    """Return (3,) ratios of exposure between colours (3, n) of the same positions; infinity is unseen."""
    thinned = slice(None, None, max(1, own.shape[1] // GAIN_PLACES))
    own, theirs = own[:, thinned], theirs[:, thinned]
    low, high = np.minimum(own, theirs).min(axis=0), own.max(axis=0)
    good = np.flatnonzero((low > 0.02) & (high < 0.9) & np.isfinite(theirs[0]))
    if len(good) < 50:
        return np.ones(3, np.float32)
    return np.asarray(np.clip(np.median(own[:, good] / theirs[:, good], axis=1), *GAINS), np.float32)


def _median(colours: list[Map], known: Indices) -> LinearRGB:
    """Return (n, 3) medians of `known` (n,) finite colours; odd-even transposition sort (Habermann 1972)."""
    ordered = list(colours)
    for turn in range(len(ordered)):
        for i in range(turn % 2, len(ordered) - 1, 2):
            a, b = ordered[i], ordered[i + 1]
            ordered[i], ordered[i + 1] = np.minimum(a, b), np.maximum(a, b)
    stack, places = np.stack(ordered), np.arange(len(known))
    low, high = (stack[np.maximum(known - odd, 0) // 2, :, places] for odd in (1, 0))
    low[known == 0] = high[known == 0] = 0
    return np.asarray((low + high) / 2, np.float32)
