"""Depth of small light sources on black, each of which gets one depth.

Nothing can be matched on black, so depth around a light is noise. A lens would spread a light with a slanted
depth into a burst of rays.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..base.arrays import Bytes, Indices, Map, Mask
from ..media.light import to_linear

WIDTH = 0.02
"""Longest side of a light as a share of the picture's. Chosen by inspection."""
CONTRAST = 0.05
"""Least difference to the surroundings, in linear light. Chosen by inspection."""
BLACK = 0.006
"""Most linear light of black surroundings. Depth around lights on lit walls is right: PSNR of bars from its
video falls by 0.09 dB with 0.02, and by 0.7 dB without a limit."""
RIM = 2
"""Pixels around a light that its glow reaches. Chosen by inspection."""


def with_lights(picture: Bytes, inverse: Map, moving: Mask | None = None) -> Map:
    """Give every small light on black, with its rim, the depth of its brightest pixel.

    Args:
        picture: (h, w, 3) uint8 RGB.
        inverse: (h, w) inverse depth in 1 / scene units.
        moving: (h, w) pixels whose depth is left alone.

    Returns:
        The inverse depth (h, w).
    """
    light = to_linear(picture)[..., :3].max(axis=2)
    lights = _lights(light)
    count = int(lights.max())
    if not count:
        return inverse
    at = np.flatnonzero(lights)
    number = lights.reshape(-1)[at] - 1
    # Sorted by light within each, so that the last one is the brightest.
    order = np.lexsort((light.reshape(-1)[at], number))
    depth = inverse.reshape(-1)[at[order[np.cumsum(np.bincount(number)) - 1]]]
    # Where rims meet, the later light has the pixel.
    reach = cv2.dilate(lights.astype(np.float32), np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)).astype(int)
    lights = np.where(lights > 0, lights, reach)
    own = (lights > 0) if moving is None else (lights > 0) & ~moving
    found = inverse.copy()
    found[own] = depth[lights[own] - 1]
    return found


def _lights(light: Map) -> Indices:
    """Number (h, w) the small lights of a picture in linear light (h, w) from 1 on; 0 elsewhere."""
    size = max(round(WIDTH * max(light.shape)), 3)
    around = cv2.morphologyEx(light, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    bright = (light > around + CONTRAST) & (around < BLACK)
    _, label, stats, _ = cv2.connectedComponentsWithStats(bright.astype(np.uint8), connectivity=8)
    is_small = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) <= size
    is_small[0] = False
    return np.where(is_small, np.cumsum(is_small), 0)[label]
