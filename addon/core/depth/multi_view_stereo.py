"""Dense inverse depth of a frame from the clip itself and the cameras that were solved for it.

Neighbour frames are chosen by baseline; a plane sweep over them, regularised by semiglobal matching, gives
each pixel's inverse depth. Moving pixels of a mask have no depth here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.lru_cache import remembered
from ..base.progress import checkpoint
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Intrinsics, Reconstruction, seen_by
from ..media.fixed_area import Fixed, nothing_fixed
from ..media.light import to_rgb8
from ..media.picture_file import Pixels
from .completion import interpolate, smooth, splat
from .light_falloff import LightFalloff, light_falloff
from .matching import Matcher, known_levels, matched_levels, winning_levels
from .plane_sweep import View, small_picture
from .source import FAINTEST
from .sparse import FEWEST_POINTS, FrameFeatures, frame_features
from .view_selection import Neighbour, parallaxes, relative_pose, select_source_views

Moving = Callable[[int], Map | Mask | None]
"""Returns the opacity in [0, 1] of moving pixels (h, w) in a source frame, at any size; None if unknown."""
WIDEST_PARALLAX = 0.1
"""Share of the longer side by which the scene's depths should move apart in the farthest neighbour."""
DEPTH_PARALLAXES = (1.0, 0.6, 0.3)
"""Shares of the widest parallax in the neighbours on either side of the frame."""
LEVEL_STEP = 1.25
"""Pixels in the farthest neighbour between two depth levels."""
LEAST_PARALLAX = 1.0
"""Pixels in the farthest neighbour; with less there is only the depth of sparse points."""
SURE_PARALLAX = 8.0
"""Pixels in the farthest neighbour from which on depth is as sure as its matches."""
PROBE_PARALLAXES = (0.5, 0.25)
"""Shares of the widest parallax in the coarse sweep for things nearer than all points."""
PROBE_ZOOM = 4
"""Reduction of the coarse sweep's pictures."""
PROBE_LEVELS = 48
"""Depth levels of the coarse sweep."""
PROBE_REACH = 3.0
"""Times the largest inverse depth of the points, up to which that coarse sweep looks."""
RANGE_MARGIN = 0.2
"""Share of the points' range of inverse depths that is searched beyond it."""
MANY_POINTS = 100
"""Points in the frame from which its range does not need those of other frames."""
BLIND_PARALLAX = 0.3
"""Share of the width by which the nearest thing moves in the farthest frame, without points."""
LONG_SIDE = 960
"""Pixels of the longer side that is worked at. Past it, time and memory grow and a blur gains little."""
LEVELS = 16, 64
"""Least and largest number of depth levels. Chosen by inspection."""
PROBE_SHARE = 0.01
"""Share of the picture that must be nearer than all points to be believed. Chosen by inspection."""
MASKED = 85
"""Fourth channel of a picture in moving pixels: seen, but no depth comes from them."""
KEPT_PICTURES = 128 << 20
"""Bytes of remembered pictures: 64 of 960x540 pixels, or all of a clip at a third of this size."""
PHOTO_LEVELS = 160
"""Largest number of depth levels of photos: a level is a step of many pixels. Chosen by inspection."""
COARSE = LONG_SIDE // 3
"""Pixels of the longer side for the coarse depth of the static scene. Chosen by inspection."""


@dataclass(frozen=True)
class DenseDepth:
    """Depth of every pixel of one frame, in the geometry of `Canvas.pinhole` at the size worked at."""

    frame: int
    """Number of the source frame."""
    inverse_depth: Map
    """(h, w) float32 1 / z in the frame's camera, in 1 / scene units; finite, not negative."""
    confidence: Map
    """(h, w) float32 in [0, 1]: 0 where the depth is only that of the surroundings or the sparse points."""
    moving: Mask
    """(h, w) moving pixels."""
    pinhole: Intrinsics
    """The pinhole that these h x w pixels are seen through."""
    past_border: Map | None = None
    """(h + 2 m, w + 2 m) inverse depth that other frames know around the picture, NaN where they do not and
    within it; None where nothing was looked for."""


class PlaneSweepStereo:
    """Dense depth of the frames of a clip. Memory is that of some pictures at the size worked at."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        read: Callable[[int], Pixels],
        long_side: int = LONG_SIDE,
        mask: Moving | None = None,
        unseen: Moving | None = None,
        matcher: Matcher = winning_levels,
        fixed: Fixed = nothing_fixed,
    ) -> None:
        """Prepare the depth of a clip's frames.

        Args:
            reconstruction: Solve of the clip.
            read: Returns a frame's picture as `Footage.read` does.
            long_side: Pixels of the longer side that is worked at.
            mask: Moving pixels of swept frames.
            unseen: Moving pixels of source views, where `mask` is too slow for these.
            matcher: Finds the depth levels.
            fixed: Returns the pixels (H, W) of all source frames that do not show the scene, if any.
        """
        self._rec, self._read, self._long_side, self._mask = reconstruction, read, long_side, mask
        self._unseen, self._matcher, self._fixed = unseen or mask, matcher, fixed

    def at(self, frame: int) -> DenseDepth:
        """Return the depth of the static scene in a frame; that of moving pixels is nowhere sure.

        UserError where the frame or a neighbour cannot be read, no frame is registered, or its lens bends
        more than a flat picture can show.
        """
        image, _ = self._rec.image_at(frame)
        masked = self.moving(frame)
        canvas, own = self.canvas(image), self._picture(frame).copy()
        own[masked, 3] = np.minimum(own[masked, 3], MASKED)
        shape = (own.shape[0], own.shape[1])
        guide = cv2.cvtColor(own[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32)
        features = frame_features(self._rec, frame, canvas)
        low, high = self._range(image.frame)
        high = self._nearest(image, own, low, high)
        middle = (low + high) / 2
        known, count = splat(features.observed, features.inverse_depth, shape)
        count[masked] = 0
        near = self._neighbours(image, (low, high), DEPTH_PARALLAXES)
        widest = max((one.parallax for one in near), default=0.0)
        median = float(np.median(features.inverse_depth)) if len(features.points) else middle
        sparse = np.maximum(interpolate(guide, known, count, median), 0)
        if widest < LEAST_PARALLAX:
            return DenseDepth(frame, sparse, np.zeros(shape, np.float32), masked, canvas.pinhole)
        most = LEVELS[1] if self._rec.is_ordered else PHOTO_LEVELS
        levels = np.linspace(low, high, int(np.clip(np.ceil(widest / LEVEL_STEP), LEVELS[0], most)))
        falloff = self._falloff(image, own, near, features)
        if falloff is not None:
            own = falloff.even(own, canvas.pinhole)
        views = [self._view(image, own, one, middle, falloff) for one in near]
        level, confidence = matched_levels(
            own, views, levels, known_levels(known, count, levels), self._matcher
        )
        inverse = low + (levels[1] - levels[0]) * smooth(level)
        inverse = np.maximum(inverse, 0).astype(np.float32)
        if widest < SURE_PARALLAX:
            share = np.float32((widest - LEAST_PARALLAX) / (SURE_PARALLAX - LEAST_PARALLAX))
            confidence *= share
            if len(features.points) >= FEWEST_POINTS:
                inverse = share * inverse + (1 - share) * sparse
        checkpoint(0.8)
        confidence = np.where(masked, np.float32(0), confidence)
        return DenseDepth(frame, inverse, confidence, masked, canvas.pinhole)

    def moving(self, frame: int) -> Mask:
        """Return the known moving pixels (h, w) of a frame, at the size worked at."""
        return self.on_canvas(self._rec.image_at(frame)[0], self._mask(frame) if self._mask else None)

    def pinhole(self, frame: int) -> Intrinsics:
        """Return the pinhole that a frame's depth is seen through, at the size worked at."""
        return self.canvas(frame).pinhole

    def canvas(self, of: Image | int) -> Canvas:
        """Return the undistorted picture of a frame at the size worked at."""
        image = of if isinstance(of, Image) else self._rec.image_at(of)[0]
        camera = self._rec.cameras[image.camera]
        zoom = min(1.0, self._long_side / max(camera.width, camera.height))
        size = max(round(camera.width * zoom), 1), max(round(camera.height * zoom), 1)
        return self._rec.canvas(image, size)

    def prefetch(self, frames: list[int]) -> None:
        """Read the pictures for the depth of frames in the order of the clip.

        A video read back and forth is decoded again and again. Errors as of `at`.
        """
        wanted = set(frames)
        for frame in frames:
            image, _ = self._rec.image_at(frame)
            span = self._range(image.frame)
            for shares in (DEPTH_PARALLAXES, PROBE_PARALLAXES):
                wanted |= {one.image.frame for one in self._neighbours(image, span, shares)}
        for each in sorted(wanted):
            checkpoint()
            self._picture(each)

    def picture(self, frame: int) -> Bytes:
        """Return (h, w, 3) sRGB of a frame, as its depth is over it."""
        return np.ascontiguousarray(self._picture(frame)[..., :3])

    @remembered(KEPT_PICTURES, lambda picture: picture.nbytes)
    def _picture(self, frame: int) -> Bytes:
        """(h, w, 4) RGB as shown in the canvas, and 255 where the lens saw something, less what is masked."""
        image, _ = self._rec.image_at(frame)
        canvas = self.canvas(image)
        size = (canvas.camera.width, canvas.camera.height)
        checkpoint()
        small = cv2.resize(to_rgb8(self._read(frame)), size, interpolation=cv2.INTER_AREA)
        small = np.dstack([small, np.full(small.shape[:2], 255, np.uint8)])
        small = _straightened(small, canvas) if canvas.camera.is_distorted else small
        small[self.on_canvas(image, self._unseen(frame) if self._unseen else None), 3] = MASKED
        small[self.on_canvas(image, self._fixed()), 3] = 0
        return small

    def on_canvas(self, image: Image, mask: Map | Mask | None) -> Mask:
        """Return the pixels (h, w) of the canvas that a mask (H, W) over the source frame touches.

        Even slightly covered pixels count, as none of their colour may be taken for the background.
        """
        canvas = self.canvas(image)
        if mask is None:
            return np.zeros((canvas.pinhole.height, canvas.pinhole.width), bool)
        size = (canvas.camera.width, canvas.camera.height)
        share = cv2.resize(np.asarray(255 * mask, np.uint8), size, interpolation=cv2.INTER_AREA)
        shown = _straightened(share, canvas) if canvas.camera.is_distorted else share
        return np.asarray(shown > 255 * FAINTEST)

    @remembered()
    def _range(self, frame: int) -> tuple[float, float]:
        """Least and largest inverse depth that anything in a frame may have."""
        image, _ = self._rec.image_at(frame)
        local, ahead = seen_by(image, self._rec, np.arange(len(self._rec.points), dtype=np.int32))
        camera = self._rec.intrinsics(image)
        xy = camera.project(local)
        with np.errstate(invalid="ignore"):
            inside = ahead & np.all((xy > 0) & (xy < [camera.width, camera.height]), axis=1)
        # Points that other frames saw may be hidden here, and are less certain.
        own = np.isin(np.arange(len(inside)), image.points)
        inside &= own | (np.count_nonzero(inside & own) < MANY_POINTS)
        if inside.sum() < FEWEST_POINTS:
            far = max(float(np.linalg.norm(other.centre - image.centre)) for other in self._rec.images)
            nearest = BLIND_PARALLAX * camera.width / camera.fx
            return 0.0, nearest / far if np.isfinite(far) and far > 0 else 1.0
        low, high = np.percentile(1 / local[inside, 2], [0.5, 99.5])
        spare = RANGE_MARGIN * max(high - low, 0.01 * high)
        # Points at infinity do not exist, so the far end is open.
        low = 0.0 if low < 0.35 * high else low - spare
        return float(low), float(high + spare)

    def _nearest(self, image: Image, own: Bytes, low: float, high: float) -> float:
        """The largest inverse depth again, where things stand nearer than all points: by a coarse sweep.

        In photos, which stand far apart, such things are found by chance: kermit (real data) has no depth
        otherwise.
        """
        if not self._rec.is_ordered:
            return high
        near = self._neighbours(image, (low, high), PROBE_PARALLAXES)
        if not near or max(one.parallax for one in near) < LEAST_PARALLAX:
            return high
        levels = np.linspace(low, PROBE_REACH * high, PROBE_LEVELS)
        views = [self._view(image, own, one, (low + high) / 2).shrunk(PROBE_ZOOM) for one in near]
        small = small_picture(own, PROBE_ZOOM)
        unknown = np.full(small.shape[:2], np.nan, np.float32)
        level, confidence = matched_levels(small, views, levels, unknown, self._matcher)
        nearer = low + (levels[1] - levels[0]) * level[confidence > 0.5]
        if np.count_nonzero(nearer > high) < PROBE_SHARE * level.size:
            return high
        return float(max(high, np.percentile(nearer, 100 - 10 * PROBE_SHARE)))

    def _neighbours(
        self, image: Image, span: tuple[float, float], shares: tuple[float, ...]
    ) -> list[Neighbour]:
        """The source views in which a span of inverse depths moves apart by shares of the widest parallax."""
        pinhole = self.canvas(image).pinhole
        wanted = [share * WIDEST_PARALLAX * max(pinhole.width, pinhole.height) for share in shares]
        return select_source_views(image, self._parallaxes(image.frame, span), wanted, self._rec.is_ordered)

    @remembered()
    def _parallaxes(self, frame: int, span: tuple[float, float]) -> list[tuple[Image, float]]:
        """The possible source views of a frame, as of `parallaxes`."""
        image, _ = self._rec.image_at(frame)
        others = [(each, self.canvas(each).pinhole) for each in self._rec.images if each is not image]
        return parallaxes(image, self.canvas(image).pinhole, others, span)

    def _falloff(
        self, image: Image, own: Bytes, near: Sequence[Neighbour], features: FrameFeatures
    ) -> LightFalloff | None:
        """The lens's loss of light towards the corners, by the features (n,) of a frame (h, w, 4)."""
        seen = [(own, self.canvas(image).pinhole, features.observed)]
        for other in (one.image for one in near):
            local, ahead = seen_by(other, self._rec, features.points)
            pinhole = self.canvas(other).pinhole
            places = np.where(ahead[:, None], pinhole.project(local), np.nan)
            seen.append((self._picture(other.frame), pinhole, places))
        return light_falloff(seen)

    def _view(
        self, image: Image, own: Bytes, near: Neighbour, middle: float, falloff: LightFalloff | None = None
    ) -> View:
        """A source view with its homographies, as bright as the frame (h, w, 4) at an inverse depth."""
        rotation, translation = relative_pose(image, near.image)
        here, there = (pixel_matrix(self.canvas(i).pinhole) for i in (image, near.image))
        back = np.linalg.inv(here)
        # The planes that are swept face the frame: their normal is its viewing direction.
        parallax = np.outer(translation, [0.0, 0.0, 1.0])
        picture = self._picture(near.image.frame)
        if falloff is not None:
            picture = falloff.even(picture, self.canvas(near.image).pinhole)
        view = View(picture, there @ rotation @ back, there @ parallax @ back, near.side)
        return view.exposed_as(own, middle)


def pixel_matrix(camera: Intrinsics) -> Floats:
    """Return (3, 3) calibration matrix K of a pinhole, with OpenCV's pixel centres."""
    return np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])


def _straightened(picture: Bytes, canvas: Canvas) -> Bytes:
    """A picture (h, w) or (h, w, 4) of the lens as the canvas has it, 0 where the lens saw nothing."""
    at = np.nan_to_num(canvas.canvas_map(), nan=-9.0)
    return np.asarray(cv2.remap(picture, at, None, cv2.INTER_LINEAR), np.uint8)  # type: ignore[call-overload]
