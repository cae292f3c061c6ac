"""Dense inverse depth of a frame from the clip itself and the cameras that were solved for it.

Neighbour frames are chosen by baseline; a plane sweep over them, regularised by semiglobal matching, gives
each pixel's inverse depth; pixels whose motion contradicts it move by themselves, as those of a mask do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint
from ..camera.canvas import Canvas
from ..camera.reconstruction import Floats, Image, Intrinsics, Reconstruction, seen_by
from ..media.clip import encode_srgb
from ..media.picture_file import Pixels
from .completion import pin, settle, smooth, splat, spread
from .motion_segmentation import MASKED, SMALLEST, covered_pixels, moving_pixels
from .plane_sweep import TRUNCATED, Bytes, Map, View, lowest, semiglobal, small_picture, sweep
from .sparse import frame_features
from .view_selection import Neighbour, choose, relative_pose

Mask = NDArray[np.bool_]
Moving = Callable[[int], Mask | None]
"""(h, w), at any size, what moves by itself in a source frame; None where nothing is known of it."""

LONGEST, COARSE = 960, 320
"""Pixels of the longer side that is worked at: past it, time and memory grow and a blur gains little; and
where only what moves is asked for."""
KEPT = 40
"""Pictures that are remembered, so that a clip taken in order reads each frame about once."""
WIDEST = 0.1
"""Of the picture's longer side, by which the scene's depths should move apart in the farthest neighbour."""
DEPTH_SHARES = (1.0, 0.6, 0.3)
"""Of that, in the neighbours on either side that the sweep uses,"""
MOTION_SHARES = (0.12, 0.05)
"""and in those that tell what moves: so close that little is hidden in them."""
STEP = 1.25
"""Pixels between two levels in the farthest neighbour."""
LEAST_LEVELS, MOST_LEVELS = 16, 64
LEAST_PARALLAX, SURE_PARALLAX = 1.0, 8.0
"""Pixels in the farthest neighbour: with less there are only sparse points; from so much on it is sure."""
PROBE_SHARES, PROBE_ZOOM, PROBE_LEVELS = (0.5, 0.25), 4, 48
"""Of the coarse sweep that looks for what stands nearer than all points; so many times smaller."""
BEYOND, PROBE_SHARE = 3.0, 0.01
"""How much nearer than all points something may be, and the share of the picture that tells so."""
SPARE = 0.2
"""Of the points' range of inverse depths, that is searched beyond it."""
FEWEST, MANY = 8, 100
"""Points that tell a range, and of the frame's own as many as tell it alone."""
BLIND = 0.3
"""Of the width, that the nearest thing moves in the farthest frame where they do not."""
MARGIN, RIVALS = 3.0, 0.2
"""A level that costs so little more than the best is a rival; with so large a share of them, none is sure."""
AROUND, TELLS = 9, 0.4
"""Pixels across, and grey levels by which the best level there must beat the mean, to tell anything."""
POOR = 0.875
"""Of the largest mismatch, at which nothing was found at all."""


@dataclass(frozen=True)
class DenseDepth:
    """Depth of every pixel of one frame, in the geometry of `Canvas.pinhole` at the size worked at."""

    frame: int
    inverse_depth: Map
    """(h, w) float32 1 / z in the frame's camera, in the reconstruction's own units; finite, not negative."""
    confidence: Map
    """(h, w) float32 in [0, 1]: 0 where the depth is only that of the surroundings or the sparse points."""
    moving: Mask
    """(h, w) what moves by itself; it has the depth of where it stands."""
    lens: Intrinsics
    """The pinhole that these h x w pixels are seen through."""


class PlaneSweepStereo:
    """Dense depth of the frames of a clip. Memory is that of some pictures at the size worked at."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        longest: int = LONGEST,
        mask: Moving | None = None,
    ) -> None:
        """`read` gives a frame's picture as `Footage.read` does; `longest` bounds the size worked at.

        `mask` gives what is known to move by itself; more may be found.
        """
        self._rec, self._read, self._longest, self._mask = reconstruction, read, longest, mask
        self._pictures = LRUCache[Bytes](KEPT)
        self._movers = LRUCache[Mask](KEPT)

    def at(self, frame: int) -> DenseDepth:
        """The depth of a frame.

        UserError where the frame or a neighbour cannot be read, no frame is registered, or its lens bends
        more than a flat picture can show.
        """
        image, _ = self._rec.image_at(frame)
        canvas, own = self._canvas(image), self._picture(image)
        shape = (own.shape[0], own.shape[1])
        guide = cv2.cvtColor(own[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32)
        features = frame_features(self._rec, frame, canvas)
        low, high = self._range(image)
        high = self._nearest(image, own, low, high)
        known, count = splat(features.observed, features.inverse_depth, shape)
        masked = self._masked(image)
        count[masked] = 0
        near = self._neighbours(image, (low, high), DEPTH_SHARES)
        widest = max((one.parallax for one in near), default=0.0)
        usual = float(np.median(features.inverse_depth)) if len(features.points) else (low + high) / 2
        sparse = np.maximum(spread(guide, known, count, usual), 0)
        if widest < LEAST_PARALLAX:
            nothing = np.zeros(shape, np.float32)
            settled = settle(guide, sparse, nothing, masked, np.zeros(shape, bool))
            return DenseDepth(frame, *settled, canvas.pinhole)
        levels = np.linspace(low, high, int(np.clip(np.ceil(widest / STEP), LEAST_LEVELS, MOST_LEVELS)))
        views = [self._view(image, own, one, (low + high) / 2) for one in near]
        level, confidence = _swept(own, views, levels, guide, known, count)
        inverse = np.maximum(low + (levels[1] - levels[0]) * smooth(level), 0).astype(np.float32)
        if widest < SURE_PARALLAX:
            share = np.float32((widest - LEAST_PARALLAX) / (SURE_PARALLAX - LEAST_PARALLAX))
            confidence *= share
            if len(features.points) >= FEWEST:
                inverse = share * inverse + (1 - share) * sparse
        checkpoint(0.8)
        moving = masked
        if min(shape) >= SMALLEST:
            close = self._neighbours(image, (low, high), MOTION_SHARES)
            closest = [self._view(image, own, one, (low + high) / 2) for one in close]
            moving = masked | moving_pixels(own, closest, inverse, (low + high) / 2)
        checkpoint(0.9)
        if moving.any():
            covered = covered_pixels(own, views, inverse, (low + high) / 2)
            inverse, confidence, moving = settle(guide, inverse, confidence, moving, covered)
        return DenseDepth(frame, inverse, confidence, moving, canvas.pinhole)

    def moving(self, frame: int) -> Mask:
        """(h, w) what moves by itself, over the source frame at the size worked at; remembered."""
        return self._movers.get(frame, lambda: self._moving(frame))

    def _moving(self, frame: int) -> Mask:
        image, _ = self._rec.image_at(frame)
        found, canvas = self.at(frame).moving, self._canvas(image)
        if not canvas.lens.is_distorted:
            return found
        share = np.dstack([found.astype(np.float32)] * 4)
        return np.asarray(canvas.to_source(share)[..., 0] > 0.5)

    def picture(self, frame: int) -> Bytes:
        """(h, w, 3) sRGB of a frame, as its depth is over it."""
        return np.ascontiguousarray(self._picture(self._rec.image_at(frame)[0])[..., :3])

    def _canvas(self, image: Image) -> Canvas:
        lens = self._rec.intrinsics(image)
        zoom = min(1.0, self._longest / max(lens.width, lens.height))
        return Canvas(lens.scaled(max(round(lens.width * zoom), 1), max(round(lens.height * zoom), 1)))

    def _picture(self, image: Image) -> Bytes:
        """(h, w, 4) RGB as shown in the canvas, and 255 where the lens saw something, less what is masked."""
        return self._pictures.get(image.frame, lambda: self._shown(image))

    def _shown(self, image: Image) -> Bytes:
        canvas = self._canvas(image)
        size = (canvas.lens.width, canvas.lens.height)
        checkpoint()
        small = cv2.resize(_displayed(self._read(image.frame)), size, interpolation=cv2.INTER_AREA)
        small = np.dstack([small, np.full(small.shape[:2], 255, np.uint8)])
        small = _straightened(small, canvas) if canvas.lens.is_distorted else small
        small[self._masked(image), 3] = MASKED
        return small

    def _masked(self, image: Image) -> Mask:
        """(h, w) of the canvas, what is known to move by itself."""
        canvas = self._canvas(image)
        mask = self._mask(image.frame) if self._mask else None
        if mask is None:
            return np.zeros((canvas.pinhole.height, canvas.pinhole.width), bool)
        size = (canvas.lens.width, canvas.lens.height)
        share = cv2.resize(mask.astype(np.uint8) * np.uint8(255), size, interpolation=cv2.INTER_AREA)
        alone = np.dstack([share] * 4)
        return np.asarray((_straightened(alone, canvas) if canvas.lens.is_distorted else alone)[..., 0] > 127)

    def _range(self, image: Image) -> tuple[float, float]:
        """Least and largest inverse depth that anything in a frame may have."""
        local, ahead = seen_by(image, self._rec, np.arange(len(self._rec.points), dtype=np.int32))
        lens = self._rec.intrinsics(image)
        xy = lens.project(local)
        with np.errstate(invalid="ignore"):
            inside = ahead & np.all((xy > 0) & (xy < [lens.width, lens.height]), axis=1)
        # Points that other frames saw may be hidden here, and are less certain.
        own = np.isin(np.arange(len(inside)), image.points)
        inside &= own | (np.count_nonzero(inside & own) < MANY)
        if inside.sum() < FEWEST:
            far = max(float(np.linalg.norm(other.centre - image.centre)) for other in self._rec.images)
            return 0.0, BLIND * lens.width / lens.fx / far if np.isfinite(far) and far > 0 else 1.0
        low, high = np.percentile(1 / local[inside, 2], [0.5, 99.5])
        spare = SPARE * max(high - low, 0.01 * high)
        # What is infinitely far has no points: nothing tells how far it is but that it moves least.
        low = 0.0 if low < 0.35 * high else low - spare
        return float(low), float(high + spare)

    def _nearest(self, image: Image, own: Bytes, low: float, high: float) -> float:
        """The largest inverse depth again, where things stand nearer than all points: by a coarse sweep."""
        near = self._neighbours(image, (low, high), PROBE_SHARES)
        if not near or max(one.parallax for one in near) < LEAST_PARALLAX:
            return high
        levels = np.linspace(low, BEYOND * high, PROBE_LEVELS)
        views = [self._view(image, own, one, (low + high) / 2).shrunk(PROBE_ZOOM) for one in near]
        small = small_picture(own, PROBE_ZOOM)
        guide = cv2.cvtColor(small[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32)
        none = np.zeros_like(guide)
        level, confidence = _swept(small, views, levels, guide, none, none)
        nearer = low + (levels[1] - levels[0]) * level[confidence > 0.5]
        if np.count_nonzero(nearer > high) < PROBE_SHARE * level.size:
            return high
        return float(max(high, np.percentile(nearer, 100 - 10 * PROBE_SHARE)))

    def _neighbours(
        self, image: Image, span: tuple[float, float], shares: tuple[float, ...]
    ) -> list[Neighbour]:
        pinhole = self._canvas(image).pinhole
        others = [(other, self._canvas(other).pinhole) for other in self._rec.images if other is not image]
        wanted = [share * WIDEST * max(pinhole.width, pinhole.height) for share in shares]
        return choose(image, pinhole, others, span, wanted)

    def _view(self, image: Image, own: Bytes, near: Neighbour, middle: float) -> View:
        turn, move = relative_pose(image, near.image)
        here, there = (pixel_matrix(self._canvas(i).pinhole) for i in (image, near.image))
        back = np.linalg.inv(here)
        ahead = np.outer(move, [0.0, 0.0, 1.0])
        view = View(self._picture(near.image), there @ turn @ back, there @ ahead @ back, near.side)
        return view.exposed_as(own, middle)


def _swept(
    own: Bytes, views: list[View], levels: Floats, guide: Map, known: Map, count: Map
) -> tuple[Map, Map]:
    """(h, w) level, with its fraction, and the confidence in it, before what the parallax says of it."""
    costs = sweep(own, views, levels, guide)
    unseen = own[..., 3] < 255
    # What lies past the lens's picture continues what lies within.
    costs[:, unseen] = 0
    checkpoint(0.5)
    told = cv2.blur(costs.mean(axis=0) - costs.min(axis=0), (AROUND, AROUND))
    checkpoint(0.5)
    pin(costs, known, count, levels)
    sums = semiglobal(costs, guide)
    checkpoint(0.7)
    best, level = lowest(sums)
    checkpoint(0.7)
    rivals = np.count_nonzero(sums < sums.min(axis=0) + np.float32(MARGIN), axis=0)
    single = np.clip(1.2 - rivals / (RIVALS * len(levels)), 0, 1)
    at = np.take_along_axis(costs, best[None], axis=0)[0]
    agreed = np.clip(2 - 2 * at / (POOR * TRUNCATED), 0, 1)
    return level, np.where(unseen, 0, single * agreed * np.clip(told / TELLS - 0.5, 0, 1)).astype(np.float32)


def pixel_matrix(lens: Intrinsics) -> Floats:
    """(3, 3) with OpenCV's pixel centres."""
    return np.array([[lens.fx, 0, lens.cx - 0.5], [0, lens.fy, lens.cy - 0.5], [0, 0, 1]])


def _displayed(picture: Pixels) -> Bytes:
    """(H, W, 3 or 4) as stored -> (H, W, 3) uint8, display encoded."""
    rgb = picture[..., :3]
    if rgb.dtype == np.float32:
        return np.round(255 * encode_srgb(np.clip(np.nan_to_num(rgb), 0, 1))).astype(np.uint8)
    if rgb.dtype == np.uint16:
        return (rgb // 256).astype(np.uint8)
    return np.ascontiguousarray(rgb, dtype=np.uint8)


def _straightened(picture: Bytes, canvas: Canvas) -> Bytes:
    """A picture (h, w, 4) of the lens as the canvas has it, 0 where the lens saw nothing."""
    pinhole = canvas.pinhole
    grid = np.stack(np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5), axis=-1)
    at = np.nan_to_num(canvas.features_to_source(grid) - 0.5, nan=-9.0).astype(np.float32)
    return np.asarray(cv2.remap(picture, at, None, cv2.INTER_LINEAR), np.uint8)  # type: ignore[call-overload]
