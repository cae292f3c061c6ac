"""What stands still, as a frame's camera sees it, also behind what moves: put together from other frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, Map, Mask
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Reconstruction
from ..depth.depth_store import DepthStore
from ..depth.exposure import exposed_as
from ..depth.map_fusion import fused, level_of
from ..depth.matching import Matcher, winning_levels
from ..depth.multi_view_stereo import (
    COARSE,
    DenseDepth,
    Moving,
    PlaneSweepStereo,
    StereoOptions,
    pixel_matrix,
)
from ..depth.reprojection import in_place
from ..depth.shared_depth import found_once, not_kept
from ..depth.view_selection import relative_pose, stride
from ..media.picture_file import Pixels

LeftOut = Callable[[int], Mask | None]
"""What moves in a source frame, (h, w) of the plate's size, None where nothing is known to."""


def _given(depth: DenseDepth) -> DenseDepth:
    return depth


def nothing(_frame: int) -> None:
    """Nothing is known to move in any frame."""


@dataclass(frozen=True)
class PlateOptions:
    """How many frames the plate comes from, and how large it is."""

    depth: StereoOptions = COARSE
    """How the depth of source frames is found: what moves is not asked of it."""
    long_side: int = 480
    """Pixels of the longer side of the plate. By eye: hands and feet of a figure a third as high as the
    picture are 4 pixels wide."""
    step: int = 8
    """Every so many-th registered frame is a source frame. By eye."""
    least_frames: int = 12
    """Source frames of a short clip, even if that needs a smaller step. By eye."""
    sides: int = 6
    """Source frames on either side. By eye: where something stays for long, more would be needed."""
    apart: int = 3
    """Frames by which a source frame is apart at least: nearer, what moves has hardly moved. By eye."""
    nearer: float = 2.0
    """Levels of depth by which what is nearer hides a place in a source frame. By eye."""
    silhouette: int = 5
    """Pixels across the window in which a jump of depth is a silhouette. By eye."""
    jump: float = 0.6
    """Share of the range of inverse depth that such a jump is, at least. Of 0.04 to 0.6, all of which keep
    pickets of the bench's fence apart from the tram behind them (0.93 to 0.95 of intersection over union,
    0.81 without), it takes least from subjects of other scenes: 0.005 of two who cross."""
    gain_step: int = 3
    """Pixels between those whose brightness is compared with the frame's."""
    least_share: float = 0.02
    """Share of the plate that a source frame has to see."""


@dataclass(frozen=True)
class Plate:
    """The static scene over a frame's undistorted picture; colours are display-encoded RGB."""

    colour: Bytes
    """(h, w, 3) median of the source frames, as bright as the frame."""
    low: Bytes
    """(h, w, 3) lower quartile of the source frames."""
    high: Bytes
    """(h, w, 3) upper quartile of the source frames."""
    count: Bytes
    """(h, w) how many source frames see the place; 0 where nothing is known of it."""
    silhouette: Mask
    """(h, w) where its depth jumps nearby: which side of that a pixel lies on is known less well."""


@dataclass(frozen=True)
class StaticPlate:
    """The plates of a clip's frames. Errors as of `PlaneSweepStereo.at`."""

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""
    masks: Moving | None = None
    """What is known to move by itself, (h, w) of a source frame at any size."""
    options: PlateOptions = field(default_factory=PlateOptions)
    store: DepthStore | None = None
    """Where the depth of source frames is kept."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels."""

    def __post_init__(self) -> None:
        wide = replace(self.options.depth, long_side=self.options.long_side)
        sweep = PlaneSweepStereo(
            self.reconstruction, self.read, self.options.depth, self.masks, matcher=self.matcher
        )
        shown = PlaneSweepStereo(self.reconstruction, self.read, wide)
        step = stride(self.reconstruction, self.options.step, self.options.least_frames)
        for name, value in (
            ("_sweep", sweep), ("_shown", shown), ("_step", step),
            ("_depths", LRUCache[DenseDepth](8 * self.options.sides)),
            ("_levels", LRUCache[float](8 * self.options.sides)),
        ):  # fmt: skip
            object.__setattr__(self, name, value)

    _sweep: PlaneSweepStereo = field(init=False, repr=False, compare=False)
    _shown: PlaneSweepStereo = field(init=False, repr=False, compare=False)
    _step: int = field(init=False, repr=False, compare=False)
    _depths: LRUCache[DenseDepth] = field(init=False, repr=False, compare=False)
    _levels: LRUCache[float] = field(init=False, repr=False, compare=False)

    def canvas(self, frame: int) -> Canvas:
        """What a frame's plate is over: its undistorted picture."""
        return self._shown.canvas(frame)

    def on_canvas(self, image: Image, mask: Map | Mask | None) -> Mask:
        """(h, w) at the plate's size, where a mask over a source frame at any size shows anything."""
        return self._shown.on_canvas(image, mask)

    def picture(self, frame: int) -> Bytes:
        """(h, w, 3) a frame's undistorted picture at the plate's size, display-encoded RGB."""
        return self._shown.picture(frame)

    @property
    def sources(self) -> list[int]:
        """The frames that plates are made from."""
        return [int(frame) for frame in self.reconstruction.frames[:: self._step]]

    def moving(self, frame: int) -> Mask:
        """(h, w) what moves in a source frame as its own neighbours tell, at the plate's size."""
        pinhole = self._shown.pinhole(frame)
        found = self._depth(frame).moving.astype(np.uint8)
        return np.asarray(
            cv2.resize(found, (pinhole.width, pinhole.height), interpolation=cv2.INTER_NEAREST) > 0
        )

    def inverse_depth(self, frame: int, moving: LeftOut = nothing) -> Map:
        """(h, w) inverse depth of what stands still in a frame, also behind what moves, in 1 / scene units.

        `moving` (h, w) by source frame is left out.
        """
        here, _ = self.reconstruction.image_at(frame)
        small, stack = self._sweep.pinhole(frame), []
        for image in self._around(frame):
            checkpoint()
            depth = self._without(self._depth(image.frame), moving(image.frame))
            inverse, weight, nearest = in_place(depth, image, small, here, 0, 4)
            # What moves in the frame itself hides what its plate shall show.
            stack.append((inverse, np.where(depth.moving, 0, weight) if image is here else weight, nearest))
        inverses, weights, nearests = (np.stack(part) for part in zip(*stack, strict=True))
        inverse, _, _ = fused(inverses, weights, nearests)
        unseen = weights.max(axis=0) <= 0
        pinhole = self._shown.pinhole(frame)
        return np.asarray(
            cv2.resize(_inpainted(inverse, unseen), (pinhole.width, pinhole.height)), np.float32
        )

    def plate(self, frame: int, moving: LeftOut = nothing) -> Plate:
        """The plate (h, w) of a frame, without what is `moving` (h, w) by source frame."""
        here, _ = self.reconstruction.image_at(frame)
        inverse, own = self.inverse_depth(frame, moving), self.picture(frame)
        seen = [
            warped for image in self._around(frame)
            if abs(image.frame - frame) >= self.options.apart
            and (warped := self._seen_by(image, here, inverse, own, moving(image.frame))) is not None
        ]  # fmt: skip
        if not seen:
            unknown = np.zeros(own.shape[:2], np.uint8)
            return Plate(own, own, own, unknown, unknown > 0)
        count = np.sum([inside for _, inside in seen], axis=0, dtype=np.uint8)
        # What a source frame does not see is sorted behind all that it does.
        ranked = _sorted([np.where(inside[..., None], colour, np.uint8(255)) for colour, inside in seen])
        last = np.maximum(count, 1) - 1
        low, middle, high = (
            np.take_along_axis(ranked, (share * last // 4)[None, ..., None], axis=0)[0] for share in (1, 2, 3)
        )
        return Plate(middle, low, high, count, self._silhouette(inverse))

    def _silhouette(self, inverse: Map) -> Mask:
        """(h, w) where inverse depth (h, w) jumps nearby."""
        window = np.ones((self.options.silhouette,) * 2, np.uint8)
        jump = cv2.morphologyEx(inverse, cv2.MORPH_GRADIENT, window)
        return np.asarray(jump > self.options.jump * (inverse.max() - inverse.min()))

    def _depth(self, frame: int) -> DenseDepth:
        return self._depths.get(frame, lambda: self._coarse([frame])[frame])

    def find_depth(self, frames: Sequence[int]) -> None:
        """Find the depth of source frames, each that no other process is at first."""
        new = [frame for frame in frames if frame not in self._depths]
        for frame, depth in self._coarse(new).items():
            self._depths.get(frame, partial(_given, depth))

    def _coarse(self, frames: Sequence[int]) -> dict[int, DenseDepth]:
        pinhole = self._sweep.pinhole
        self._sweep.prefetch(not_kept(self.store, "coarse", frames, pinhole))
        return found_once(self.store, "coarse", frames, pinhole, self._sweep.at)

    def around(self, frame: int) -> list[int]:
        """The source frames of a frame."""
        return [image.frame for image in self._around(frame)]

    def _around(self, frame: int) -> list[Image]:
        """The source frames of a frame."""
        images, at = self.reconstruction.images, int(np.searchsorted(self.reconstruction.frames, frame))
        span = self.options.sides * self._step
        return [images[i] for i in range(0, len(images), self._step) if abs(i - at) <= span]

    @staticmethod
    def _without(depth: DenseDepth, moving: Mask | None) -> DenseDepth:
        if moving is None:
            return depth
        size = depth.moving.shape[::-1]
        found = cv2.resize(moving.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        return replace(depth, moving=depth.moving | found)

    def _seen_by(
        self, image: Image, here: Image, inverse: Map, own: Bytes, moving: Mask | None
    ) -> tuple[Bytes, Mask] | None:
        """A source frame's picture (h, w, 3) where the inverse depth (h, w) of a frame has it, as bright as
        the frame's own (h, w, 3), and where (h, w) it sees something still; None where that is too little."""
        checkpoint()
        picture = self.picture(image.frame)
        rotation, translation = relative_pose(here, image)
        there, back = (
            pixel_matrix(self._shown.pinhole(image.frame)),
            np.linalg.inv(pixel_matrix(self._shown.pinhole(here.frame))),
        )
        at, closer = _places(there @ rotation @ back, there @ translation, inverse)
        height, width = picture.shape[:2]
        x, y = cv2.split(at)
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        inside &= ~self._occluded(image.frame, at, inverse * closer)
        if moving is not None:
            hidden = cv2.remap(moving.astype(np.uint8), at, None, cv2.INTER_NEAREST)  # type: ignore[call-overload]
            inside &= hidden == 0
        if inside.mean() < self.options.least_share:
            return None
        colour = cv2.remap(picture, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
        every = np.s_[:: self.options.gain_step, :: self.options.gain_step]
        return exposed_as(colour, *(one[every][inside[every]] for one in (own, colour))), inside

    def _occluded(self, frame: int, at: Map, inverse: Map) -> Mask:
        """(h, w) whether something nearer than inverse depths (h, w) is at places (h, w, 2) of a source
        frame."""
        depth = self._depth(frame).inverse_depth
        small = self._shown.pinhole(frame)
        zoom = np.array(depth.shape[::-1], np.float32) / np.array([small.width, small.height], np.float32)
        # The least around: pixels at a silhouette may be of either surface.
        least = cv2.erode(depth, np.ones((3, 3), np.uint8))
        own = cv2.remap(least, (at + 0.5) * zoom - 0.5, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
        return np.asarray(
            own > inverse + self._levels.get(frame, lambda: self.options.nearer * level_of(depth))
        )


def _places(matrix: Floats, parallax: Floats, inverse: Map) -> tuple[Map, Map]:
    """(h, w, 2) float32 pixels of another picture at which pixels of inverse depth (h, w) are seen, by the
    homography (3, 3) of what is infinitely far and its parallax (3,); and (h, w) times as large as it is here
    that their inverse depth is there."""
    height, width = inverse.shape
    m, t = matrix.astype(np.float32), parallax.astype(np.float32)
    across, down = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)[:, None]
    x, y, z = (m[i, 0] * across + (m[i, 1] * down + m[i, 2]) + t[i] * inverse for i in range(3))
    scale = np.where(z > 0.05, 1 / np.maximum(z, np.float32(0.05)), np.float32(-1e6))
    return np.asarray(cv2.merge([x * scale, y * scale]), np.float32), np.asarray(scale, np.float32)


def summed(picture: Bytes | Map) -> Map:
    """(h, w) float32 sum of the three channels of a picture (h, w, 3)."""
    return np.asarray(cv2.transform(picture.astype(np.float32), np.ones((1, 3), np.float32)), np.float32)


def _inpainted(inverse: Map, unseen: Mask) -> Map:
    """Inverse depth (h, w) with that of the surroundings where it is not known (h, w)."""
    high = float(inverse.max())
    if not unseen.any() or high <= 0:
        return inverse
    steps = np.rint(inverse * (65535 / high)).astype(np.uint16)
    found = cv2.inpaint(steps, unseen.astype(np.uint8), 3, cv2.INPAINT_NS)
    return np.where(unseen, found * np.float32(high / 65535), inverse).astype(np.float32)


def _sorted(stack: list[Bytes]) -> Bytes:
    """(n, h, w, c) of n pictures (h, w, c), each value sorted among them.

    Batcher's odd-even merge sort ("Sorting networks and their applications", 1968): whole pictures are
    compared, which takes a tenth of the time that sorting the values of each pixel takes.
    """
    found, n = list(stack), len(stack)
    span = 1
    while span < n:
        step = span
        while step >= 1:
            for first in range(step % span, n - step, 2 * step):
                for low in range(first, min(first + step, n - step)):
                    if low // (2 * span) == (low + step) // (2 * span):
                        a, b = found[low], found[low + step]
                        found[low], found[low + step] = np.minimum(a, b), np.maximum(a, b)
            step //= 2
        span *= 2
    return np.stack(found)
