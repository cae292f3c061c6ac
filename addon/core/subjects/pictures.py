"""Small pictures of a clip's frames, in which subjects are found, and optical flow between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from ..base.arrays import Bytes, Mask
from ..base.lru_cache import remembered
from ..media.light import encode_srgb
from ..media.picture_file import Pixels
from .flow import ClipFlow

LONG_SIDE = 512
"""Pixels of the long side. The networks see crops of at most 256 pixels; a guided filter finds the
outline at the frame's own size."""
KEPT = 64 << 20
"""Most bytes of remembered pictures: 150 of 16:9."""


EVERY = 4
"""Frames between key frames. Mean intersection over union by a segmenter: swan 0.860 with 2, 0.933 with 4,
0.935 with 8; scooter 0.840 with 4, 0.798 with 8."""


@dataclass(frozen=True)
class ClipPictures:
    """Small pictures of a clip's frames."""

    frames: tuple[int, ...]
    """Numbers of the frames, ascending."""
    read: Callable[[int], Pixels]
    """A frame's picture (H, W, 3 or 4) as `Footage.read` gives it."""

    @remembered(KEPT, lambda picture: picture.nbytes)
    def picture(self, frame: int) -> Bytes:
        """Return a frame's picture (h, w, 3), display-encoded RGB. Errors as of `read`."""
        return small(self.read(frame))

    @property
    def keys(self) -> tuple[int, ...]:
        """Key frames: every `EVERY`th of the clip, and the last one."""
        return *self.frames[:-1:EVERY], self.frames[-1]

    def of_keys(self, values: Mask) -> Mask:
        """Return (n,) for each frame the value of the last key frame up to it, from those (k,) of `keys`."""
        return np.repeat(values, EVERY)[: len(self.frames)]

    @cached_property
    def flow(self) -> ClipFlow:
        """Optical flow between frames."""
        return ClipFlow(self.picture)


def small(stored: Pixels) -> Bytes:
    """Return a picture (h, w, 3), its long side `LONG_SIDE`, display-encoded RGB, of a stored one."""
    colour = np.ascontiguousarray(stored[..., :3])
    times = LONG_SIDE / max(colour.shape[:2])
    size = tuple(max(round(side * times), 1) for side in colour.shape[1::-1])
    return displayed(np.asarray(cv2.resize(colour, size, interpolation=cv2.INTER_AREA)))


def displayed(stored: Pixels) -> Bytes:
    """Return a picture (H, W, 3), display-encoded RGB, of one (H, W, 3 or 4) as it is stored."""
    colour = np.ascontiguousarray(stored[..., :3])
    if colour.dtype == np.uint8:
        return np.asarray(colour, np.uint8)
    if colour.dtype == np.uint16:
        return np.asarray(np.asarray(colour, np.uint16) // 256, np.uint8)
    return np.rint(255 * encode_srgb(np.clip(colour, 0, 1))).astype(np.uint8)
