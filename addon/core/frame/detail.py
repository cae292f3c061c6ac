"""What follows from blur discs, seen through the views, as the sharpness of a frame that is drawn smaller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import LinearRGBA, Map
from .inspection import blur_discs
from .warped_frame import WarpedFrame

SHARP, BLURRED = 0.5, 1.5
"""Blur discs in pixels of the small picture, up to which what only the large one shows is kept, and from
which on nothing of it is. A disc of one leaves 0.46 of half as fine again as the small picture's finest
frequency, the middle of what was lost, by the disc's transform 2 J1(x) / x."""


def sharp_frame(warped: WarpedFrame) -> WarpedFrame | None:
    """A frame's mesh and views, painted with the share of its sharpness that each texel keeps instead of its
    colours: red of the views' mean is the share that each pixel keeps. None of a frame without layers."""
    if not warped.layers:
        return None

    def share(disc: Map) -> Map:
        kept = np.clip((BLURRED - disc) / (BLURRED - SHARP), 0, 1)
        return np.asarray(kept[..., None], np.float32)

    return painted(warped, share)


def painted(warped: WarpedFrame, value: Callable[[Map], Map]) -> WarpedFrame:
    """A frame's mesh and views, painted with what `value` makes (h, w, up to 3) of the diameters (h, w) in
    pixels of its texels' blur discs, instead of its colours."""
    if not warped.layers:
        # The texture is the canvas itself.
        values, alpha = (
            value(np.abs(np.nan_to_num(blur_discs(warped))).astype(np.float32)),
            warped.texture[..., 3:],
        )
        rest = np.zeros((*alpha.shape[:2], 3 - values.shape[2]), np.float32)
        texture = np.concatenate([alpha * values, rest, alpha], axis=2)
        return replace(warped, texture=texture, highlight_discs=None)
    layers, lens = warped.layers, warped.plan.lens
    parts = warped.texture.reshape(len(layers) + 1, -1, warped.texture.shape[1], 4)
    finer = parts.shape[2] // layers[0].is_far.shape[1]
    near = [np.where(one.is_far, one.near_disparity, one.front_disparity) for one in layers]
    painted = np.zeros_like(parts)
    surfaces = zip(painted, parts[..., 3], [*near, layers[-1].back_disparity], strict=True)
    for part, alpha, disparity in surfaces:
        disc = 2 * np.abs(lens.snap_displacement(disparity))
        values = np.repeat(np.repeat(value(disc), finer, axis=0), finer, axis=1)
        part[..., : values.shape[2]] = alpha[..., None] * values
        part[..., 3] = alpha
    return replace(warped, texture=painted.reshape(warped.texture.shape), highlight_discs=None)


def enlarged(picture: LinearRGBA, small: LinearRGBA, source: LinearRGBA, share: Map | None) -> LinearRGBA:
    """A picture (h, w, 4) at the size of the source (H, W, 4), premultiplied, with its `share` (h, w) of what
    the source has more than `small` (h, w, 4), which is the source as it was drawn."""
    size = source.shape[1], source.shape[0]

    def at_size(smaller: LinearRGBA) -> LinearRGBA:
        return np.asarray(cv2.resize(smaller, size, interpolation=cv2.INTER_CUBIC), np.float32)

    large = at_size(picture)
    if share is not None:
        kept = cv2.resize(np.clip(share, 0, 1), size, interpolation=cv2.INTER_LINEAR)
        large += kept[..., None] * (source - at_size(small))
    large[..., 3] = np.minimum(large[..., 3], 1)
    return np.maximum(large, 0)
