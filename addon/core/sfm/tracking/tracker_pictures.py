"""Pictures of the tracker's work, small enough to be sent to the process that waits for the solve."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Bytes, Floats
from ...media.light import to_rgb8
from ...media.picture_file import Pixels

WIDTH, MOST = 480, 500
"""Pixels across of a picture, and features in it. Chosen by inspection: enough to follow the work."""
EVERY = 0.5
"""Seconds between two pictures; a redraw takes 0.06 to 0.3 s in software OpenGL, beside the solve."""


class Watch:
    """Tells what is seen, now and then; called with every frame."""

    def __init__(self, tell: Callable[[Sight], object]) -> None:
        self._tell, self._told = tell, -EVERY

    def __call__(self, picture: Pixels, places: Floats) -> None:
        """A frame (H, W, 3 or 4) as stored, and places (n, 2) in it as fractions of its size."""
        now = time.monotonic()
        if now - self._told < EVERY:
            return
        self._told = now
        self._tell(sight_of(picture, places))


@dataclass(frozen=True, eq=False)
class Sight:
    """A picture and its features."""

    picture: Bytes
    """(h, w, 3) sRGB."""
    places: NDArray[np.float32]
    """(n, 2) features as fractions of the picture, (0, 0) top left."""


def sight_of(picture: Pixels, places: Floats) -> Sight:
    """Return a frame (H, W, 3 or 4) as stored, made small, with places (n, 2) as fractions of its size.

    Many places are thinned out evenly.
    """
    height, width = picture.shape[:2]
    size = min(WIDTH, width), max(1, round(min(WIDTH, width) * height / width))
    small = cv2.resize(to_rgb8(picture), size, interpolation=cv2.INTER_AREA)
    some = places[:: -(-len(places) // MOST) or 1]
    return Sight(small.astype(np.uint8), some.astype(np.float32))
