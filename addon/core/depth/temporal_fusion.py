"""Depth that is steady in time: each frame's own, with that of frames around it brought into its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..base.arrays import Bytes, Map
from ..base.errors import UserError
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint, part
from ..base.store import NOT_KEPT, Entry, Store
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Reconstruction
from .map_fusion import (
    BEYOND,
    KEPT_FRAMES,
    LEAST_FRAMES,
    FusionOptions,
    even,
    filled,
    fused,
    level_of,
    past_border,
    sharpened,
    without_islands,
    without_outliers,
    without_speckles,
)
from .multi_view_stereo import DenseDepth, PlaneSweepStereo
from .reprojection import in_place
from .stored_depth import depth_entry
from .subject_depth import Subject, with_subjects
from .view_selection import nearest_views, stride

DEFAULTS = FusionOptions()
"""Those of normal quality."""


class TemporalFusion:
    """Depth of the frames of a clip, asked for in order. Memory is that of a few frames."""

    def __init__(
        self,
        reconstruction: Reconstruction,
        single_frame: PlaneSweepStereo,
        store: Store = NOT_KEPT,
        options: FusionOptions = DEFAULTS,
        subjects: Callable[[], Sequence[Subject]] = tuple,
    ) -> None:
        """`single_frame` finds each frame's own depth; `store` keeps depth; `subjects` are placed in it."""
        self._rec, self._stereo, self._options, self._store = reconstruction, single_frame, options, store
        self._kept, self._subjects = LRUCache[DenseDepth](KEPT_FRAMES), subjects

    def at(self, frame: int) -> DenseDepth:
        """Return the depth of a frame, kept or found. Errors as of `PlaneSweepStereo.at`."""
        return self._store.get(self._entry("depth", frame), partial(self._found, frame))

    def kept(self, frame: int) -> DenseDepth | None:
        """Return the depth of a frame as it is kept, None where it would have to be found; errors as `at`."""
        return self._store.read(self._entry("depth", frame))

    def _entry(self, kind: str, frame: int) -> Entry[DenseDepth]:
        return depth_entry(kind, frame, self._stereo.pinhole(frame))

    def canvas(self, frame: int) -> Canvas:
        """Return the undistorted picture of a frame at the size that depth is found at."""
        return self._stereo.canvas(frame)

    @property
    def not_kept(self) -> UserError | None:
        """Why the last depth that was found is not kept; None where it is, or nothing is to be."""
        return self._store.problem

    def _found(self, frame: int) -> DenseDepth:
        """The depth of a frame from the key frames around it.

        The weighted median of all frames around, and the mean of those near it (Merrell et al., "Real-time
        visibility-based fusion of depth maps", 2007); where that is not sure, what is sure around it.
        """
        image, _ = self._rec.image_at(frame)
        options, keys = self._options, self._around(frame)
        depths = self._single_frames([key.frame for key in keys])
        own = next((depth for depth in depths if depth.frame == image.frame), None)
        stack = [self._in_place(depth, key, image) for depth, key in zip(depths, keys, strict=True)]
        inner = (slice(self._margin(frame), -self._margin(frame)),) * 2
        unseen = np.mean(np.maximum.reduce([weight[inner] for _, weight, _ in stack]) <= 0)
        if own is None and unseen > options.most_unseen:
            (own,) = self._single_frames([image.frame])
            stack.append(self._in_place(own, image, image))
        inverses, weights, nearest = (
            np.stack([each[inner] for each in part]) for part in zip(*stack, strict=True)
        )
        inverse, confidence, level = fused(inverses, weights, nearest)
        checkpoint(1.0)
        picture, moving = self._stereo.picture(frame), self._stereo.moving(frame)
        confidence = without_outliers(picture, inverse, confidence, level)
        checkpoint(1.0)
        inverse, disputed = filled(picture, inverse, confidence, level, moving)
        checkpoint(1.0)
        inverse = without_islands(sharpened(even(inverse, level), level, disputed), confidence, level)
        found = self._with_subjects(image.frame, inverse, confidence, picture)
        # Subjects may have changed the range.
        inverse = without_speckles(found.inverse_depth, level_of(found.inverse_depth))
        return replace(found, inverse_depth=inverse, past_border=past_border(stack, inverse, level))

    def _with_subjects(self, frame: int, inverse: Map, confidence: Map, picture: Bytes) -> DenseDepth:
        """Depth (h, w) of the static scene in a frame, and that of its subjects."""
        stereo = self._stereo
        moving = stereo.moving(frame)
        confidence = np.where(moving, np.float32(0), confidence)
        static = DenseDepth(frame, inverse, confidence, moving, stereo.pinhole(frame))
        if not moving.any():
            return static
        image, _ = self._rec.image_at(frame)
        subjects = [
            (stereo.on_canvas(image, each.mask(frame)), each.inverse_depth(frame))
            for each in self._subjects()
        ]
        return with_subjects(static, picture, subjects)

    def _in_place(self, depth: DenseDepth, image: Image, here: Image) -> tuple[Map, Map, Map]:
        """`in_place` of a key frame for another frame."""
        checkpoint(1.0)
        pinhole, margin = self._stereo.pinhole(here.frame), self._margin(here.frame)
        return in_place(depth, image, pinhole, here, margin)

    def _margin(self, frame: int) -> int:
        """Pixels past a frame's border to which depth is found."""
        pinhole = self._stereo.pinhole(frame)
        return max(int(BEYOND * max(pinhole.width, pinhole.height)), 1)

    def _around(self, frame: int) -> list[Image]:
        """The key frames around a frame, itself if it is one; the clip's last frame is one."""
        options, images = self._options, self._rec.images
        step = stride(self._rec, options.step, LEAST_FRAMES)
        at, span = int(np.searchsorted(self._rec.frames, frame)), options.sides * step
        if not self._rec.is_ordered:
            beside = nearest_views(self._rec, self._rec.image_at(frame)[0], 2 * options.sides)
            return [self._rec.image_at(frame)[0], *beside]
        last = len(images) - 1
        near = {*range(0, last, step), last} & {*range(at - span, at + span + 1)}
        return [images[number] for number in sorted(near)]

    def _single_frames(self, frames: Sequence[int]) -> list[DenseDepth]:
        """The depth of frames by themselves."""
        # Remembered frames take no time.
        there = {frame: depth for frame in frames if (depth := self._kept.known(frame)) is not None}
        new = [frame for frame in frames if frame not in there]
        entries = {frame: self._entry("single", frame) for frame in new}
        self._stereo.prefetch([frame for frame in new if self._store.read(entries[frame]) is None])

        def find(frame: int) -> DenseDepth:
            with part(new.index(frame), len(new)):
                return self._stereo.at(frame)

        there |= self._store.made(entries, find)
        return [self._kept.get(frame, partial(there.__getitem__, frame)) for frame in frames]
