"""Functions of the blur disc drawn through the views, such as the sharpness of smaller frames."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA, Map
from ..warp.layer import Layer
from .frame import Frame
from .inspection import blur_discs, fewer_views

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


def sharp_frame(frame: Frame) -> Frame | None:
    """Paint a frame's layers with the share of sharpness that each texel keeps, for fewer views.

    None without layers of every pixel's depth. The mean of the views has in red, green and blue the share
    that each pixel keeps.
    """
    if not frame.is_layered:
        return None
    frame = fewer_views(frame, VIEWS)
    nearer = np.float32(frame.views.lens.disparity_scale * frame.views.axial_shift)

    def shares(displacement: Map) -> LinearRGB:
        green = _share(displacement)
        apart = _share(displacement + nearer) if nearer else green
        return np.dstack([apart, green, apart])

    return painted(frame, shares)


def painted(frame: Frame, values: Callable[[Map], LinearRGB], on_cg: float = 0.0) -> Frame:
    """Paint a frame's layers with a function of displacement, and CG objects with a value `on_cg`.

    `values` maps displacements (h, w) of texels in pixels, the signed radii of blur discs, to colours (h, w,
    3).
    """
    views, snap = frame.views, frame.views.lens.snap_displacement

    def of_discs(displacement: Map) -> LinearRGB:
        return values(views.discs(snap(displacement) if frame.is_layered else displacement))

    return painted_by_disparity(frame, of_discs, on_cg)


def painted_by_disparity(frame: Frame, values: Callable[[Map], LinearRGB], on_cg: float = 0.0) -> Frame:
    """Paint as `painted` does by displacements that are not snapped to the focal plane."""
    # A steadier camera's layers are made for a larger aperture.
    share = np.float32(frame.steadied.aperture_share if frame.steadied else 1.0)

    def one(layer: Layer) -> Layer:
        # Without a disparity, the picture is the canvas.
        radii = share * layer.disparity if layer.disparity.size else np.nan_to_num(blur_discs(frame) / 2)
        return layer.painted(values(radii.astype(np.float32)))

    return replace(
        # The channels are not colours.
        frame, views=replace(frame.views, axial_colour=0.0), highlight_discs=None,
        layers=tuple(map(one, frame.layers)),
        cg_layers=tuple(each.painted(on_cg) for each in frame.cg_layers),
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
