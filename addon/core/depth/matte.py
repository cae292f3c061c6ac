"""The outline of moving objects at a frame's own size, and their depth up to it."""

import cv2
import numpy as np

from ..base.arrays import Bytes, Floats, LinearRGBA, Map, Mask
from ..base.nearest_fill import of_nearest
from ..camera.canvas import Canvas
from ..media.light import to_rgb8
from .source import FAINTEST

VOTES = 2
"""Pixels of the size that depth is found at, within which upsampling may mistake one surface for another: it
chooses among the four around."""
GUIDE_RADIUS = 4.0
"""Radius of the guided filter in pixels of the frame. For a figure at 1920 px whose mask is uneven by a pixel
of 960, it leaves a fifth to a half of the wrong pixels of upsampling by colour; 2 leaves more, and 6 leaves
more where colours are alike."""
GUIDE_EPSILON = 100.0
"""Squared grey levels that count as one surface in that filter: from 30 to 300 it hardly matters there."""
WIDE, RADIUS = 1.5, 1 / 80
"""Radius of the guided filter over the width of the unsure band, and over the picture's at most. Five crops
have 0.4 to 1.1 dB more than with 1 / 120; without the former a cow by a segmenter has twice the halo."""
EPSILON = 1e-4 * 255**2
"""Squared grey levels that count as one surface in it."""
SOLID = (0.05, 0.95)
"""Opacities of the filter that become 0 and 1."""


def opacity_over(canvas: Canvas, mask: Map | Mask) -> Map:
    """Return (H, W) in [0, 1] over a canvas, of opacities (h, w) over its source frame at any size."""
    size = (canvas.camera.width, canvas.camera.height)
    how = cv2.INTER_AREA if mask.shape[1] > size[0] else cv2.INTER_LINEAR
    share = cv2.resize(np.asarray(mask, np.float32), size, interpolation=how)
    if canvas.camera.is_distorted:
        share = canvas.from_source(share)
    return np.asarray(np.clip(share, 0, 1), np.float32)


def outline_of(moving: Mask, picture: LinearRGBA) -> Mask:
    """Return the moving pixels (H, W) of a picture (H, W, 4), linear, from a small mask (h, w).

    He, Sun and Tang, "Guided image filtering", 2010, within `GUIDE_RADIUS` of the outline.
    """
    size = picture.shape[1], picture.shape[0]
    whole = cv2.resize(moving.astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    radius = int(np.ceil(GUIDE_RADIUS * size[0] / moving.shape[1]))
    part = around(whole > 0, 2 * radius)
    found = whole > 0.5
    near = np.ascontiguousarray(whole[part])
    found[part] = cv2.ximgproc.guidedFilter(to_rgb8(picture[part]), near, radius, GUIDE_EPSILON) > 0.5
    return np.asarray(found)


def around(mask: Mask, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns of a mask (H, W) and `reach` pixels around.

    A guided filter, a mean of means, reaches twice its radius.
    """
    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    rows = slice(max(top - reach, 0), top + height + reach)
    return rows, slice(max(left - reach, 0), left + width + reach)


def outlined(
    inverse: Floats, found: Map, moving: Mask, picture: LinearRGBA, opacity: Map | None = None
) -> Floats:
    """Return inverse depth (H, W) with the outline of moving objects.

    Partly covered pixels have the depth of the object, those beside it that of the static scene: upsampling
    by colour fails in hair, and leaves teeth where a mask is uneven.

    Args:
        inverse: (H, W) upsampled from `found`.
        found: (h, w) small inverse depth.
        moving: (h, w) moving pixels.
        picture: (H, W, 4), which gives the outline where it is larger than `found`.
        opacity: (H, W) matte, which gives the outline instead.
    """
    if not moving.any() or moving.all():
        return inverse
    size, still = inverse.shape[::-1], ~moving
    reach = 2 * int(np.ceil(VOTES * size[0] / found.shape[1])) + 1
    around = np.ones((reach, reach), np.uint8)
    covered = None if moving.shape == inverse.shape else outline_of(moving, picture)
    if opacity is not None:
        matte = opacity > FAINTEST
        own = cv2.dilate(matte.astype(np.uint8), around) > 0
        # Besides, what else was found to move.
        covered = matte if covered is None else np.where(own, matte, covered)
    if covered is None:
        return inverse

    def of(seeds: Mask) -> Map:
        return np.asarray(cv2.resize(of_nearest(found, seeds)[0], size, interpolation=cv2.INTER_NEAREST))

    near, behind = of(moving), of(still)
    result = np.where(covered, near, inverse)
    beside = ~covered & (cv2.dilate(covered.astype(np.uint8), around) > 0)
    mistaken = beside & (np.abs(inverse - near) < np.abs(inverse - behind))
    result[mistaken] = behind[mistaken]
    return result


def matte(picture: Bytes, share: Bytes) -> Map:
    """Estimate the opacity of a subject from its probability in a smaller picture (He, Sun and Tang, 2010).

    Args:
        picture: (H, W, 3) uint8 RGB, display-encoded.
        share: (h, w) probability in 255ths.

    Returns:
        (H, W) float32 in [0, 1].
    """
    odds = np.square(np.arange(256, dtype=np.float32))
    # The probability of twice the log-odds: most of the picture is sure.
    surer = odds / (odds + odds[::-1])
    whole = cv2.resize(surer[share], picture.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    own, unsure = (whole > 0.5).astype(np.uint8), np.count_nonzero((whole > 0.02) & (whole < 0.98))
    outline = int(np.count_nonzero(cv2.dilate(own, np.ones((3, 3), np.uint8)) != own))
    radius = max(round(min(RADIUS * picture.shape[1], WIDE * unsure / max(outline, 1))), 1)
    part = around(whole > 0.02, 2 * radius)
    found = np.zeros(picture.shape[:2], np.float32)
    guide, near = np.ascontiguousarray(picture[part]), np.ascontiguousarray(whole[part])
    low, high = SOLID
    soft = cv2.ximgproc.guidedFilter(guide, near, radius, EPSILON)
    found[part] = np.clip((soft - low) / (high - low), 0, 1)
    return found
