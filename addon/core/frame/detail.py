"""Functions of the blur disc drawn through the views, such as the sharpness of smaller frames."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA, Map, repeated
from .inspection import blur_discs, fewer_views
from .warped_frame import WarpedFrame

SHARP, BLURRED = 0.5, 1.5
"""Blur discs in pixels of the small picture up to which the large one's detail is kept, and from which it is
lost. A disc of one leaves 0.46 of the middle of the lost frequencies, half as fine again as the small
picture's finest, by the disc's transform 2 J1(x) / x."""
VIEWS = 8
"""Views of a share from 0 to 1, of sharpness or of lost noise: steps of an eighth are invisible. A picture of
82 views differs by 77.7 dB, one of 16 by 95.0 dB."""
NEARER = 0.01
"""Difference in colour, of three channels as square roots of light, for a pixel of distance: of equal colours
the nearest pixel is taken. Chosen by inspection."""


def sharp_frame(warped: WarpedFrame) -> WarpedFrame | None:
    """Paint a frame's mesh with the share of sharpness that each texel keeps, for fewer views.

    None without layers.

    The mean of the views has in red, green and blue the share that each pixel keeps.
    """
    if not warped.layers:
        return None
    warped = fewer_views(warped, VIEWS)
    lens = warped.plan.lens
    nearer = np.float32(lens.disparity_scale * warped.plan.axial_shift)

    def shares(displacement: Map) -> LinearRGB:
        green = _share(displacement)
        apart = _share(displacement + nearer) if nearer else green
        return np.dstack([apart, green, apart])

    return painted(warped, shares)


def painted(warped: WarpedFrame, values: Callable[[Map], LinearRGB], on_cg: float = 0.0) -> WarpedFrame:
    """Paint a frame's mesh with a function of displacement, and CG objects with a value `on_cg`.

    `values` maps displacements (h, w) of texels in pixels, the signed radii of blur discs, to colours (h, w,
    3).
    """
    plan, snap = warped.plan, warped.plan.lens.snap_displacement

    def of_discs(displacement: Map) -> LinearRGB:
        return values(plan.discs(snap(displacement) if warped.layers else displacement))

    return painted_by_disparity(warped, of_discs, on_cg)


def painted_by_disparity(
    warped: WarpedFrame, values: Callable[[Map], LinearRGB], on_cg: float = 0.0
) -> WarpedFrame:
    """Paint as `painted` does by displacements that are not snapped to the focal plane."""
    # The channels are not colours.
    plan = replace(warped.plan, axial_colour=0.0)
    if not warped.layers:
        # The texture is the canvas itself.
        displacement = np.nan_to_num(blur_discs(warped) / 2).astype(np.float32)
        alpha = warped.texture[..., 3:]
        texture = np.concatenate([alpha * values(displacement), alpha], axis=2)
        cg = tuple(each.painted(on_cg) for each in warped.cg)
        return replace(warped, plan=plan, texture=texture, highlight_discs=None, cg=cg)
    layers = warped.layers
    # A steadier camera's layers are made for a larger aperture.
    share = np.float32(warped.steadied.aperture_share if warped.steadied else 1.0)
    parts = warped.texture.reshape(len(layers) + 1, -1, warped.texture.shape[1], 4)
    finer = parts.shape[2] // layers[0].is_far.shape[1]
    painting = np.zeros_like(parts)
    disparities = [*(one.drawn_disparity for one in layers), layers[-1].back_disparity]
    for part, alpha, disparity in zip(painting, parts[..., 3], disparities, strict=True):
        made = values(share * disparity)
        part[..., :3] = alpha[..., None] * repeated(made, finer)
        part[..., 3] = alpha
    return replace(
        warped, plan=plan, texture=painting.reshape(warped.texture.shape), highlight_discs=None,
        cg=tuple(each.painted(on_cg) for each in warped.cg),
    )  # fmt: skip


def _share(displacement: Map) -> Map:
    """Return the share (h, w) of sharpness that is left in discs of radii (h, w) in pixels."""
    disc = 2 * np.abs(displacement)
    return np.asarray(np.clip((BLURRED - disc) / (BLURRED - SHARP), 0, 1), np.float32)


def enlarged(
    picture: LinearRGBA, small: LinearRGBA, source: LinearRGBA, share: LinearRGB | None
) -> LinearRGBA:
    """Enlarge a picture (h, w, 4) to the size of its source (H, W, 4), with a share of its detail.

    Detail is the source's difference from `small` (h, w, 4), as which it was drawn. The share (h, w, 3) of
    green is that of opacity, too.
    """
    size = source.shape[1], source.shape[0]

    def at_size(smaller: LinearRGBA) -> LinearRGBA:
        return np.asarray(cv2.resize(smaller, size, interpolation=cv2.INTER_CUBIC), np.float32)

    large = at_size(picture)
    if share is not None:
        kept = cv2.resize(np.clip(share, 0, 1), size, interpolation=cv2.INTER_LINEAR)
        drawn_as = at_size(small)
        # Beside a silhouette, `small` has colours of both sides, and the picture those of one.
        lowest = np.minimum(np.minimum(large, drawn_as), source)
        highest = np.maximum(np.maximum(large, drawn_as), source)
        large = np.clip(large + kept[..., [0, 1, 2, 1]] * (source - drawn_as), lowest, highest)
    large[..., 3] = np.minimum(large[..., 3], 1)
    return np.maximum(large, 0)


def enlarged_values(values: Map, small: LinearRGBA, source: LinearRGBA) -> Map:
    """Enlarge values (h, w) of a small picture (h, w, 4) to the size of its source (H, W, 4), without mixing.

    Each pixel takes the value of one of the four small pixels around it: that of the most similar colour.
    """
    (height, width), (rows, columns) = source.shape[:2], values.shape
    if (rows, columns) == (height, width):
        return values
    y = (np.arange(height) + 0.5) * rows / height - 0.5
    x = (np.arange(width) + 0.5) * columns / width - 0.5
    shown, known = (np.sqrt(np.maximum(each[..., :3], 0)) for each in (source, small))
    best, least = np.zeros((height, width), values.dtype), np.full((height, width), np.inf, np.float32)
    for down in (0, 1):
        row = np.floor(y).astype(int) + down
        for right in (0, 1):
            column = np.floor(x).astype(int) + right
            at = np.ix_(np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1))
            away = np.abs(row - y)[:, None] + np.abs(column - x)
            miss = np.abs(shown - known[at]).sum(axis=-1) + np.float32(NEARER) * away.astype(np.float32)
            taken = miss < least
            best[taken], least[taken] = values[at][taken], miss[taken]
    return best


def resized(picture: LinearRGBA, size: tuple[int, int]) -> LinearRGBA:
    """Return a picture (H, W, 4) in linear light at another size (width, height), without negative light."""
    if (picture.shape[1], picture.shape[0]) == size:
        return picture
    shrinks = size[0] < picture.shape[1]
    resampled = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    return np.maximum(np.asarray(resampled, dtype=np.float32), 0)
