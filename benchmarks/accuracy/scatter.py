"""Classical scatter: every pixel of one sharp picture spread over its own blur disc.

The competitor that needs nothing but a picture and its depth, as the classical renderer of BokehMe (Peng et
al. 2022) and the layered ones before it (Kraus and Strengert 2007). It fills nothing in: what a blurred thing
hides stays unknown, and where too little light arrives, what did arrive is scaled up.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]

GROWTH = 1.05
"""Discs of neighbouring layers differ by a pixel, or by this factor if that is more."""
ROUNDING = 1e-6
"""Coverage under which a layer is not there but for the convolution's float32, which goes by Fourier."""
COLUMNS = 16
"""Columns a pixel that a disc is integrated over."""


def scatter(picture: Picture, disc: Floats) -> Picture:
    """Depth of field by scattering.

    `picture` is (H, W, 3) float32 linear light; `disc` (H, W) the signed blur disc diameter in pixels,
    positive nearer than the focal plane, negative farther: a larger value is always nearer. Returns
    (H, W, 3) float32.

    The pixels are sorted into layers by their disc, each shared between the two layers it lies between.
    A layer is spread with one anti-aliased disc of unit weight and laid *behind* the nearer ones by the
    "disjoint over" operator (X Rendering Extension): coverage adds up until it is full. Layers of one
    surface cover different parts of the lens at a pixel, so they must add: plain "over" takes them for
    unrelated and lets what lies behind a slanted surface shine through it. Past the border, picture and
    disc go on as they are at the border. What is still not covered is made up for by scaling.

    Raises ValueError if the sizes differ or a disc is not finite.
    """
    if picture.shape[:2] != disc.shape:
        raise ValueError(f"the picture is {picture.shape[:2]}, its discs {disc.shape}")
    if not np.isfinite(disc).all():
        raise ValueError("a blur disc is not finite")
    levels = layer_discs(float(disc.min()), float(disc.max()))
    margin = disc_kernel(float(np.abs(levels).max())).shape[0] // 2
    picture = np.pad(picture, ((margin, margin), (margin, margin), (0, 0)), mode="edge")
    disc = np.pad(disc, margin, mode="edge")
    total = np.zeros((*disc.shape, 4), dtype=np.float32)
    for index in range(len(levels) - 1, -1, -1):
        share = _share(disc, levels, index)
        _add_behind(total, picture, share, abs(float(levels[index])))
    height, width = disc.shape
    total = total[margin : height - margin, margin : width - margin]
    return np.asarray(total[..., :3] / total[..., 3:])


def layer_discs(lowest: float, highest: float) -> Floats:
    """(N,) rising signed disc diameters that hold lowest..highest between them, 0 always among them."""

    def upwards(largest: float) -> list[float]:
        found = [0.0]
        while found[-1] < largest:
            found.append(max(found[-1] + 1, found[-1] * GROWTH))
        return found[1:]

    return np.array([-d for d in reversed(upwards(-lowest))] + [0.0] + upwards(highest))


@lru_cache(maxsize=256)
def disc_kernel(diameter: float) -> Picture:
    """(K, K) float32, K odd: the share of each pixel that a centred disc covers, summing to one.

    A disc of up to one pixel lies within its own pixel: the kernel is a single one.
    """
    radius = diameter / 2
    reach = max(int(np.ceil(radius - 0.5)), 0)
    x = (np.arange((2 * reach + 1) * COLUMNS) + 0.5) / COLUMNS - reach - 0.5
    chord = np.sqrt(np.maximum(radius**2 - x**2, 0))
    y = np.arange(-reach, reach + 1)[:, None]
    covered = np.minimum(chord, y + 0.5) - np.maximum(-chord, y - 0.5)
    kernel = np.maximum(covered, 0).reshape(2 * reach + 1, 2 * reach + 1, COLUMNS).sum(axis=2)
    if reach == 0:
        kernel = np.ones((1, 1))
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def _share(disc: Floats, levels: Floats, index: int) -> Picture:
    """(H, W) part of each pixel that belongs to one layer: 1 at its disc, 0 at its neighbours'."""
    share = np.zeros(disc.shape)
    level = levels[index]
    for other in {max(index - 1, 0), min(index + 1, len(levels) - 1)} - {index}:
        towards = (disc - level) / (levels[other] - level)
        share += np.where((towards > 0) & (towards < 1), 1 - towards, 0)
    share[disc == level] = 1
    return share.astype(np.float32)


def _add_behind(total: Picture, picture: Picture, share: Picture, diameter: float) -> None:
    """Spread one layer and lay it behind what is there: `total`, (H, W, 4) premultiplied, in place."""
    rows, columns = np.flatnonzero(share.any(axis=1)), np.flatnonzero(share.any(axis=0))
    if not rows.size:
        return
    kernel = disc_kernel(diameter)
    reach = kernel.shape[0] // 2
    box = (
        slice(max(int(rows[0]) - reach, 0), int(rows[-1]) + reach + 1),
        slice(max(int(columns[0]) - reach, 0), int(columns[-1]) + reach + 1),
    )
    layer = np.dstack([picture[box] * share[box][..., None], share[box]])
    if reach:
        layer = cv2.filter2D(layer, -1, kernel, borderType=cv2.BORDER_CONSTANT)
    coverage = layer[..., 3:]
    light = coverage > ROUNDING
    room = 1 - total[box][..., 3:]
    fits = np.where(light, np.minimum(coverage, room) / np.where(light, coverage, 1), 0)
    total[box] += layer * fits
