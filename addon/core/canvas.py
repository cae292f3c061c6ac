"""Undoing lens distortion before the warp, and putting it back afterwards."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from .reconstruction import Floats, Intrinsics

Picture = NDArray[np.float32]

MAX_PADDING = 0.25
"""Strong barrel distortion sends corners to infinity: at most this share of the side is padded."""


@dataclass(frozen=True)
class Canvas:
    """The pinhole picture in which views are drawn.

    It is the source lens without its distortion, padded until every source pixel has a place. Without
    distortion it is the source frame itself and nothing is resampled.
    """

    lens: Intrinsics
    """The source lens at the size of the rendered frame."""

    @cached_property
    def pinhole(self) -> Intrinsics:
        """The padded canvas as a distortion-free lens."""
        plain = self.lens.without_distortion()
        if not self.lens.is_distorted:
            return plain
        width, height = self.lens.width, self.lens.height
        across, down = np.linspace(0, width, 65), np.linspace(0, height, 65)
        border = np.concatenate([
            np.stack(np.meshgrid(across, [0.0, height]), axis=-1).reshape(-1, 2),
            np.stack(np.meshgrid([0.0, width], down), axis=-1).reshape(-1, 2),
        ])  # fmt: skip
        reach = self.lens.pinhole_pixels(border)
        limit = MAX_PADDING * np.array([width, height])
        before = np.ceil(np.clip(-reach.min(axis=0), 0, limit)).astype(int)
        after = np.ceil(np.clip(reach.max(axis=0) - [width, height], 0, limit)).astype(int)
        return replace(
            plain,
            width=width + int(before[0] + after[0]), height=height + int(before[1] + after[1]),
            cx=plain.cx + float(before[0]), cy=plain.cy + float(before[1]),
        )  # fmt: skip

    def features_from_source(self, xy: Floats) -> Floats:
        """Source pixels (n, 2) -> canvas pixels (n, 2)."""
        return self.lens.pinhole_pixels(xy) + (self.pinhole.principal_point - self.lens.principal_point)

    def from_source(self, picture: Picture) -> Picture:
        """(H, W, 4) float32 source frame -> the canvas picture, mirrored where the lens saw nothing."""
        if not self.lens.is_distorted:
            return picture
        grid = _pixel_centres(self.pinhole.width, self.pinhole.height)
        rays = (grid - self.pinhole.principal_point) / self.pinhole.focal
        return _sample(picture, self.lens.distort(rays) * self.lens.focal + self.lens.principal_point)

    def to_source(self, picture: Picture) -> Picture:
        """(h, w, 4) float32 canvas picture -> (H, W, 4) in the geometry of the source frame."""
        if not self.lens.is_distorted:
            return picture
        grid = _pixel_centres(self.lens.width, self.lens.height)
        return _sample(picture, self.features_from_source(grid))


def _pixel_centres(width: int, height: int) -> Floats:
    across, down = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([across, down], axis=-1)


def _sample(picture: Picture, xy: Floats) -> Picture:
    # OpenCV counts from the centre of the first pixel, COLMAP from its corner. Lanczos keeps the
    # sharpness that two bilinear passes would lose; its overshoot below black is cut.
    at = (xy - 0.5).astype(np.float32)
    sampled = cv2.remap(
        picture,
        at,
        None,
        cv2.INTER_LANCZOS4,
        borderMode=cv2.BORDER_REFLECT,  # type: ignore[call-overload]
    )
    return np.asarray(np.maximum(sampled, 0), dtype=np.float32)
