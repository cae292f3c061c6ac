"""Depth found in a small picture for every pixel of the large one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA
from ..base.progress import checkpoint


@dataclass(frozen=True)
class UpsamplingOptions:
    """When a pixel takes one neighbour's depth instead of their mean, and whose."""

    colour_distance: float = 0.04
    """Distance of colours (display values, 0 to 1) that counts as much as a small picture's pixel. By eye."""
    discontinuity: float = 0.03
    """Share of the largest inverse depth; where neighbours differ by more, none is a mean. By eye."""


def upsampled(
    depth: NDArray[np.floating], picture: LinearRGBA, options: UpsamplingOptions = UpsamplingOptions()
) -> Floats:
    """(H, W) of small inverse depths (h, w), their jumps where the large picture (H, W, 4) has its edges.

    Of the four neighbours in the small picture the one is taken that is nearest and most alike in colour.
    Kopf et al., "Joint bilateral upsampling", 2007, with a single vote.
    """
    height, width = picture.shape[:2]
    if depth.shape == (height, width):
        return depth.astype(np.float64)
    small = depth.astype(np.float32)
    shown = cv2.pow(np.clip(picture[..., :3], 0, 1), 1 / 2.2)
    guide = cv2.resize(shown, small.shape[::-1], interpolation=cv2.INTER_AREA)
    x = (np.arange(width, dtype=np.float32) + 0.5) * (small.shape[1] / width) - 0.5
    y = (np.arange(height, dtype=np.float32) + 0.5) * (small.shape[0] / height) - 0.5
    best = np.full((height, width), np.inf, np.float32)
    chosen, bilinear = np.zeros_like(best), np.zeros_like(best)
    low, high = np.full_like(best, np.inf), np.full_like(best, -np.inf)
    for row in (np.floor(y), np.floor(y) + 1):
        for column in (np.floor(x), np.floor(x) + 1):
            checkpoint(1.0)
            at = np.ix_(
                np.clip(row, 0, small.shape[0] - 1).astype(int),
                np.clip(column, 0, small.shape[1] - 1).astype(int),
            )
            value = small[at]
            weight = (1 - np.abs(y - row))[:, None] * (1 - np.abs(x - column))
            unlike = shown - guide[at]
            off = np.sqrt(np.einsum("hwc,hwc->hw", unlike, unlike)) / np.float32(options.colour_distance)
            off += 1 - weight
            nearer = off < best
            np.copyto(best, off, where=nearer)
            np.copyto(chosen, value, where=nearer)
            bilinear += weight * value
            low, high = np.minimum(low, value), np.maximum(high, value)
    jumps = high - low > options.discontinuity * float(small.max(initial=0))
    return np.where(jumps, chosen, bilinear).astype(np.float64)
