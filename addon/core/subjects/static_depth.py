"""Coarse depth of the static scene in a frame, also behind moving objects, from other frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Map, Mask
from ..base.lru_cache import remembered
from ..base.progress import checkpoint
from ..base.store import NOT_KEPT, Entry, Store
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image, Reconstruction
from ..depth.map_fusion import fused
from ..depth.matching import Matcher, winning_levels
from ..depth.multi_view_stereo import COARSE, DenseDepth, Moving, PlaneSweepStereo
from ..depth.reprojection import in_place
from ..depth.stored_depth import depth_entry
from ..depth.view_selection import stride
from ..media.fixed_area import Fixed, nothing_fixed
from ..media.picture_file import Pixels

LONG_SIDE = 480
"""Pixels of the longer side of the returned depth."""
STEP, LEAST_FRAMES = 8, 12
"""Registered frames from one source frame to the next, and source frames of a short clip, even if that needs
a smaller step."""
SIDES = 6
"""Source frames on either side of a frame."""


@dataclass(frozen=True)
class StaticDepth:
    """The depth of the static scene in a clip's frames. Errors as of `PlaneSweepStereo.at`."""

    reconstruction: Reconstruction
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""
    masks: Moving | None = None
    """Known moving pixels, (h, w) of a source frame at any size."""
    store: Store = NOT_KEPT
    """Storage of the source frames' depth."""
    matcher: Matcher = winning_levels
    """Finds the depth levels of pixels."""
    fixed: Fixed = nothing_fixed
    """The pixels that do not show the scene."""

    @cached_property
    def _sweep(self) -> PlaneSweepStereo:
        return PlaneSweepStereo(
            self.reconstruction, self.read, COARSE, self.masks, matcher=self.matcher, fixed=self.fixed
        )

    @cached_property
    def _shown(self) -> PlaneSweepStereo:
        return PlaneSweepStereo(self.reconstruction, self.read, LONG_SIDE)

    def canvas(self, frame: int) -> Canvas:
        """Return the undistorted picture of a frame at the size of its depth."""
        return self._shown.canvas(frame)

    def on_canvas(self, image: Image, mask: Map | Mask | None) -> Mask:
        """Return a mask over the source frame, of any size, on that picture (h, w)."""
        return self._shown.on_canvas(image, mask)

    def inverse_depth(self, frame: int, moving: Callable[[int], Mask]) -> Map:
        """Estimate the inverse depth of the static scene in a frame, also behind moving objects.

        Args:
            frame: Number of the frame.
            moving: Returns the moving pixels (h, w) of a source frame, at any size; these are left out.

        Returns:
            (h, w) in 1 / scene units.
        """
        here, _ = self.reconstruction.image_at(frame)
        small, stack, around = self._sweep.pinhole(frame), [], self._around(frame)
        is_kept = self.store.is_kept
        self._sweep.prefetch([each.frame for each in around if not is_kept(self._entry(each.frame).name)])
        for image in around:
            checkpoint()
            depth = self._depth(image.frame)
            size = depth.moving.shape[::-1]
            left_out = cv2.resize(moving(image.frame).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
            depth = replace(depth, moving=depth.moving | (left_out > 0))
            inverse, weight, nearest = in_place(depth, image, small, here, 0)
            # Moving pixels of the frame itself hide the static scene.
            stack.append((inverse, np.where(depth.moving, 0, weight) if image is here else weight, nearest))
        inverses, weights, nearests = (np.stack(part) for part in zip(*stack, strict=True))
        inverse, _, _ = fused(inverses, weights, nearests)
        unseen = weights.max(axis=0) <= 0
        pinhole = self._shown.pinhole(frame)
        return np.asarray(
            cv2.resize(_inpainted(inverse, unseen), (pinhole.width, pinhole.height)), np.float32
        )

    @remembered(8 * SIDES)
    def _depth(self, frame: int) -> DenseDepth:
        return self.store.get(self._entry(frame), lambda: self._sweep.at(frame))

    def _entry(self, frame: int) -> Entry[DenseDepth]:
        return depth_entry("coarse", frame, self._sweep.pinhole(frame))

    def _around(self, frame: int) -> list[Image]:
        """The source frames of a frame."""
        images, at = self.reconstruction.images, int(np.searchsorted(self.reconstruction.frames, frame))
        step = stride(self.reconstruction, STEP, LEAST_FRAMES)
        return [images[i] for i in range(0, len(images), step) if abs(i - at) <= SIDES * step]


def _inpainted(inverse: Map, unseen: Mask) -> Map:
    """Inverse depth (h, w) with that of the surroundings where it is not known (h, w)."""
    high = float(inverse.max())
    if not unseen.any() or high <= 0:
        return inverse
    steps = np.rint(inverse * (65535 / high)).astype(np.uint16)
    found = cv2.inpaint(steps, unseen.astype(np.uint8), 3, cv2.INPAINT_NS)
    return np.where(unseen, found * np.float32(high / 65535), inverse).astype(np.float32)
