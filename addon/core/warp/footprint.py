"""The texture of a layered mesh, prefiltered for the number of views that draw it.

A lens is sampled at N positions, each of which stands for an N-th of the aperture: from one position to the
next a texel moves by its footprint, a disc of radius d / sqrt(N) for a texel displaced by d pixels at the
aperture's rim. Blurred over that disc, few views look like many, and what is in focus stays as it is.
Levoy and Hanrahan, "Light field rendering", 1996, prefilter over the aperture for the same reason; the
footprint of a texture is Heckbert's, "Fundamentals of texture mapping and image warping", 1989.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, LinearRGBA, Map, Mask
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side
from .layered_depth_image import LayeredDepthImage

TILE = 64
"""Texels across a tile, a multiple of all `Level.shrink`: each is blurred only as widely as it needs."""
SUBSAMPLES = 32
"""Along a texel, by which a disc's rim is sampled: its area is right to 0.3 %."""
BISECTIONS = 16
"""By which a disc's radius is found, to a 50,000th."""
WIDEST = 256.0
"""Texels; wider footprints are blurred as this one, wider than most that layers are displaced by."""
BURIED = 8
"""Pixels behind a near surface that a view may see, half of `layered_depth_image.EXTRAPOLATION`: farther
behind, the surface itself shows next."""


@dataclass(frozen=True)
class Level:
    """A width that is blurred by; those between are interpolated."""

    radius: float
    """Texels."""
    shrink: int
    """Texels across a cell of the raster on which it is done."""


def _levels() -> tuple[Level, ...]:
    """Radii a half to a third apart, each on a raster where it takes at most nine cells across."""
    octaves = 2.0 ** np.arange(int(np.log2(WIDEST)) + 1)
    radii = np.stack([octaves, 1.5 * octaves], axis=1).ravel().tolist()
    return Level(0.0, 1), *(Level(r, max(1, int(2 ** np.floor(np.log2(r / 2))))) for r in radii)


LEVELS = _levels()


def prefilter(texture: LinearRGBA, layers: Sequence[LayeredDepthImage], radius: Callable[[Map], Map]) -> None:
    """Blur the texture (n h, w, 4) of n - 1 layers and the background in place.

    Near surfaces are blurred together with their alpha, as far as they are drawn; the last one stays opaque.
    No surface bleeds into another. Passes checkpoints.

    Args:
        texture: Premultiplied.
        layers: The layers.
        radius: Returns the footprints' radii (H, W) in pixels of disparities (H, W).
    """
    width = layers[0].is_far.shape[1]
    parts = texture.reshape(len(layers) + 1, -1, texture.shape[1], 4)
    finer = parts.shape[2] // width
    # The last one first: it takes the others' texels where it is buried, as they are.
    last = np.asarray(radius(layers[-1].back_disparity), np.float32)
    buried = [(part, _buried(layer)) for part, layer in zip(parts, layers, strict=False)]
    # Tiles look at each other as they were.
    spare = np.empty_like(parts[-1])
    _filter(parts[-1], spare, finer, last, None, buried)
    parts[-1, ..., 3] = 1
    for part, layer in zip(parts, layers, strict=False):
        assert layer.drawn is not None
        own = np.where(layer.is_far & layer.drawn, layer.near_disparity, layer.front_disparity)
        kept = layer.drawn | _goes_on(layer)
        _filter(part, spare, finer, np.where(layer.drawn, radius(own), 0).astype(np.float32), kept, [])


def prefilter_alone(texture: LinearRGBA, radius: Map) -> None:
    """Blur a texture (h, w, 4) that lies alone, with its alpha, in place; `radius` (h, w) in its texels.

    Passes checkpoints.
    """
    _filter(texture, np.empty_like(texture), 1, radius.astype(np.float32), None, [])


def _goes_on(layer: LayeredDepthImage) -> Mask:
    """(H, W) pixels past the triangles of a near surface where it goes on, drawn as part of another one."""
    assert layer.drawn is not None
    if layer.drawn.all() or not layer.drawn.any():
        return layer.drawn
    beyond = (~layer.drawn).astype(np.uint8)
    _, label = cv2.distanceTransformWithLabels(beyond, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    alpha = np.zeros(label.max() + 1, np.float32)
    alpha[label[layer.drawn]] = layer.front[layer.drawn, 3]
    return np.asarray(alpha[label] > 0.5)


def _buried(layer: LayeredDepthImage) -> Mask:
    """(H, W) pixels behind a near surface that are nearer to where that is drawn in the far one's place."""
    around = np.ones((2 * BURIED + 1, 2 * BURIED + 1), np.uint8)
    return np.asarray(layer.occluded & (cv2.dilate(layer.disoccluded.astype(np.uint8), around) == 0))


def _filter(
    part: LinearRGBA,
    spare: LinearRGBA,
    finer: int,
    radius: Map,
    kept: Mask | None,
    buried: Sequence[tuple[LinearRGBA, Mask]],
) -> None:
    """Blur a part of the texture (h, w, 4), `finer` times as fine as its footprints' radii (H, W).

    `spare` (h, w, 4) is written to. Texels that are not `kept` (H, W) count as transparent; where others are
    `buried` (H, W), their texels (h, w, 4) replace this part's in the filter.
    """
    rows, columns = (range(0, finer * n, TILE) for n in radius.shape)
    places = [(row, column) for row in rows for column in columns]
    work = partial(_tile, part, spare, finer, radius, kept, buried)
    blurred = side_by_side(work, places)
    for (row, column), is_blurred in zip(places, blurred, strict=True):
        if is_blurred:
            tile = slice(row, row + TILE), slice(column, column + TILE)
            part[tile] = spare[tile]


def _tile(
    part: LinearRGBA,
    result: LinearRGBA,
    finer: int,
    radius: Map,
    kept: Mask | None,
    buried: Sequence[tuple[LinearRGBA, Mask]],
    place: tuple[int, int],
) -> bool:
    """Blur the texels of one tile into `result`, as `_filter` describes; False where it stays as it is."""
    own = radius[tuple(slice(n // finer, (n + TILE) // finer) for n in place)]
    widest, least = (min(finer * float(n), WIDEST) for n in (own.max(), own.min()))
    if widest == 0:
        return False
    checkpoint(0.95)
    own = np.minimum(finer * _finer(own, finer), WIDEST)
    radii = [level.radius for level in LEVELS]
    first = min(int(np.searchsorted(radii, least, "right")) - 1, len(LEVELS) - 2)
    used = LEVELS[first : max(int(np.searchsorted(radii, widest)), first + 1) + 1]
    # Cells of the coarsest raster, past the widest disc and the reach of interpolation.
    step = used[-1].shrink
    margin = step * int(np.ceil(used[-1].radius / step) + 2)
    around = _around(part, finer, kept, buried, place, (own.shape[0], own.shape[1]), margin)
    inner = slice(margin, margin + own.shape[0]), slice(margin, margin + own.shape[1])
    rows, columns = (slice(n, n + size) for n, size in zip(place, own.shape, strict=True))
    tile = result[rows, columns]
    tile[:] = _blurred(around, used[0])[inner]
    squared = own * own
    for below, level in pairwise(used):
        # Variances add up, and are as the square of the radius: linear in that from one to the next.
        share = (squared - below.radius**2) / (level.radius**2 - below.radius**2)
        more = _blurred(around, level)[inner] - tile
        more *= cv2.merge([np.clip(share, 0, 1, out=share)] * 4)
        tile += more
    if least == 0:
        sharp = own == 0
        tile[sharp] = part[rows, columns][sharp]
    return True


def _around(
    part: LinearRGBA,
    finer: int,
    kept: Mask | None,
    buried: Sequence[tuple[LinearRGBA, Mask]],
    place: tuple[int, int],
    size: tuple[int, int],
    margin: int,
) -> LinearRGBA:
    """(h, w, 4) the texels of a tile and `margin` around, for `_filter`; past the border as at it."""
    low = [max(0, n - margin) for n in place]
    high = [min(whole, n + own + margin) for whole, n, own in zip(part.shape, place, size, strict=False)]
    texels = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
    pixels = tuple(slice(a // finer, -(-b // finer)) for a, b in zip(low, high, strict=True))
    cut = tuple(slice(a % finer, a % finer + b - a) for a, b in zip(low, high, strict=True))
    found = part[texels]
    if kept is not None and not kept[pixels].all():
        shown = _finer(kept[pixels].astype(np.uint8), finer)[cut]
        found = np.asarray(cv2.copyTo(found, np.ascontiguousarray(shown)), np.float32)
    for other, mask in buried:
        if mask[pixels].any():
            hidden = _finer(mask[pixels].astype(np.float32), finer)[cut] > 0
            opaque = other[texels][..., 3:] == 1
            found = np.where(hidden[..., None] & opaque, other[texels], found)
    top, left = (margin - (n - a) for n, a in zip(place, low, strict=True))
    bottom, right = (margin - (b - n - own) for b, n, own in zip(high, place, size, strict=True))
    if top or left or bottom or right:
        found = cv2.copyMakeBorder(found, top, bottom, left, right, cv2.BORDER_REPLICATE)
    return np.asarray(found, np.float32)


def _finer[T: np.generic](values: NDArray[T], finer: int) -> NDArray[T]:
    """(h, w) values of pixels (H, W) at the texels of a texture so many times as fine."""
    return np.asarray(np.repeat(np.repeat(values, finer, axis=0), finer, axis=1))


def _blurred(around: LinearRGBA, level: Level) -> LinearRGBA:
    """(h, w, 4) texels blurred by a disc of a level; those near the border are not to be used."""
    if not level.radius:
        return around
    if level.shrink == 1:
        blurred = cv2.filter2D(around, -1, disc_kernel(level.radius), borderType=cv2.BORDER_REPLICATE)
        return np.asarray(blurred, np.float32)
    height, width = around.shape[:2]
    size = -(-width // level.shrink), -(-height // level.shrink)
    wide = cv2.copyMakeBorder(
        around, 0, size[1] * level.shrink - height, 0, size[0] * level.shrink - width, cv2.BORDER_REPLICATE
    )
    small = cv2.resize(wide, size, interpolation=cv2.INTER_AREA)
    # The mean over a cell and linear interpolation blur, too: a twelfth and a sixth of a cell squared.
    left = np.sqrt((level.radius / level.shrink) ** 2 - 4 * (1 / 12 + 1 / 6))
    small = cv2.filter2D(small, -1, disc_kernel(float(left)), borderType=cv2.BORDER_REPLICATE)
    whole = cv2.resize(small, wide.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(whole[:height, :width])


@lru_cache
def disc_kernel(radius: float) -> Map:
    """(k, k) weights of the cells around the middle of a disc of so many cells, 0.5 or more; their sum is 1.

    They are the shares of a disc that lie in the cells, of one that is so much smaller that the weights have
    the variance of the one that is meant.
    """
    low, high = 0.0, radius
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        shares = _shares(middle)
        spread = (shares.sum(axis=0) * (np.arange(len(shares)) - len(shares) // 2) ** 2).sum()
        low, high = (middle, high) if spread < radius**2 / 4 else (low, middle)
    return np.asarray(_shares(high), np.float32)


def _shares(radius: float) -> Floats:
    """(k, k) shares of a disc of so many cells that lie in the cells around its middle; their sum is 1."""
    reach = max(0, int(np.ceil(radius - 0.5)))
    place = (np.arange(SUBSAMPLES * (2 * reach + 1)) + 0.5) / SUBSAMPLES - reach - 0.5
    inside = place[:, None] ** 2 + place**2 <= radius**2
    shares = inside.reshape(2 * reach + 1, SUBSAMPLES, 2 * reach + 1, SUBSAMPLES).mean(axis=(1, 3))
    return np.asarray(shares / max(shares.sum(), 1e-9))
