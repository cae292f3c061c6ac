"""Moving objects of the user's masks, followed through the clip by their overlap with themselves."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numpy as np

from ..base.arrays import Bytes, Ints, Map, Mask
from ..base.errors import UserError
from ..base.nearest_fill import of_nearest
from ..base.store import LONGEST_SIDE, decoded, encoded
from ..depth.source import FAINTEST
from ..depth.subject_depth import connected

MOST = 255
"""Objects of a clip that are followed."""
SAME_AREA = 1.6
"""Ratio of an object's areas in two frames, at most; two objects that meet are another object."""
SMALLEST = 20
"""Pixels of the smallest object in a picture of `size`."""


@dataclass(frozen=True)
class MaskedObjects:
    """The objects that masks show. Errors as of `mask`."""

    frames: Sequence[int]
    """Numbers of the frames, ascending."""
    mask: Callable[[int], Map | Mask | None]
    """Returns the opacity (H, W) in [0, 1] of moving pixels, over the source frame at any size."""
    size: tuple[int, int]
    """(height, width) of the pictures in which objects are followed."""

    @property
    def numbers(self) -> range:
        """The numbers of all objects."""
        return range(1, max((int(self._labels(frame).max()) for frame in self.frames), default=0) + 1)

    def small(self, number: int, frame: int) -> Mask:
        """Return an object (h, w) in a frame, at `size`."""
        return np.asarray(self._labels(frame) == number)

    def _labels(self, frame: int) -> Bytes:
        """(h, w) number of the object of each pixel, at `size`; 0 beside all of them."""
        kept = decoded(self._followed[frame], LONGEST_SIDE) if frame in self._followed else None
        return np.zeros(self.size, np.uint8) if kept is None else np.asarray(kept, np.uint8)

    def whole(self, number: int) -> Callable[[int], Mask]:
        """Return what gives an object (H, W) in a frame at the mask's size; every pixel is in one object."""
        return partial(self._whole, number)

    def _whole(self, number: int, frame: int) -> Mask:
        mask, labels = self.mask(frame), self._labels(frame)
        if mask is None or not (labels == number).any():
            return np.zeros(self.size, bool)
        owner, _ = of_nearest(labels, labels > 0)
        size = mask.shape[::-1]
        own = cv2.resize((owner == number).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        return np.asarray((own > 0) & (np.asarray(mask, np.float32) > FAINTEST))

    @cached_property
    def _followed(self) -> dict[int, Bytes]:
        """`_labels` of frames with objects, as PNG files."""
        found, before, count = dict[int, Bytes](), np.zeros(self.size, np.uint8), 0
        for frame in self.frames:
            parts = self._parts(frame)
            labels = _continued(parts, before, count)
            if labels.any():
                found[frame], before = encoded(labels), labels
                count = max(count, int(labels.max()))
        return found

    def _parts(self, frame: int) -> Ints:
        """(h, w) labels of the connected parts of a frame's mask; a damaged mask fails in its own frame."""
        mask = None
        with contextlib.suppress(UserError):
            mask = self.mask(frame)
        if mask is None:
            return np.zeros(self.size, np.int32)
        shown = np.asarray(np.asarray(mask, np.float32) > FAINTEST, np.float32)
        return connected(cv2.resize(shown, self.size[::-1], interpolation=cv2.INTER_AREA) > 0.5)


def _continued(parts: Ints, before: Bytes, count: int) -> Bytes:
    """Numbers (h, w) of parts (h, w): of the objects that they overlap most, or new ones after `count`."""
    labels = np.zeros(parts.shape, np.uint8)
    areas = np.bincount(parts.ravel())
    old = np.bincount(before.ravel(), minlength=MOST + 1)
    for part in 1 + np.argsort(-areas[1:], kind="stable"):
        if areas[part] < SMALLEST:
            break
        here = parts == part
        overlap = np.bincount(before[here], minlength=MOST + 1)
        overlap[0] = 0
        best = int(overlap.argmax())
        is_same = overlap[best] > 0 and 1 / SAME_AREA < areas[part] / old[best] < SAME_AREA
        if not is_same and count == MOST:
            continue
        if not is_same:
            count += 1
        labels[here] = best if is_same else count
        # Another part is another object.
        before = np.where(before == best, np.uint8(0), before) if is_same else before
    return labels
