"""Pictures made as bright, and as white, as another frame of the clip: exposure and white balance drift."""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Bytes

FOOT = 255 * 0.055
"""Grey levels, which added to those of sRGB (IEC 61966-2-1) make them a power of light, but for the darkest:
light times a factor is levels times one."""
CLIPPED = 250
"""Grey level from which a pixel may be clipped. Chosen by inspection."""
LEAST = 0.004
"""Relative difference of levels that is left alone: a step of 8 bits in white."""


def exposed_as(picture: Bytes, own: Bytes, theirs: Bytes) -> Bytes:
    """Return a picture (h, w, 3), display-encoded, with the brightness of a frame in each channel.

    The factor is the median over places that both show: the frame's colours (n, 3) and the picture's (n, 3).
    The picture is unchanged if they hardly differ, or if all places are clipped.
    """
    clear = np.maximum(own, theirs).max(axis=1, initial=0) < CLIPPED
    if not clear.any():
        return picture
    gain = np.median((own[clear] + FOOT) / (theirs[clear] + FOOT), axis=0)
    if np.abs(gain - 1).max() < LEAST:
        return picture
    levels = (np.arange(256)[:, None] + FOOT) * gain - FOOT
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return np.asarray(cv2.LUT(np.ascontiguousarray(picture), table[None]), np.uint8)
