"""Layered depth image of a frame: the visible surfaces and those behind silhouettes.

Shade, Gortler, He and Szeliski, "Layered depth images", 1998. Depths are disparities in pixels at the
aperture's rim relative to the focal plane: (inverse depth - that of the focal plane) x aperture radius x
focal length. So a bound in pixels fits any scene and aperture, and float32 is exact where the picture is
sharp.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import LinearRGB, LinearRGBA, Map, Mask, in_channels
from ..base.nearest_fill import of_nearest
from ..base.progress import checkpoint
from ..depth.source import FAINTEST
from .matting import (
    MOST_THROUGH,
    Surfaces,
    behind,
    corrected,
    matted,
    parted,
    surfaces_beside,
    with_reprojected,
)
from .quadtree import COARSEST_AT_SILHOUETTES

Fill = Callable[[Map, Mask], tuple[LinearRGB, Mask]]
"""Returns colours (H, W, 3) of a surface of disparities (H, W) in a mask (H, W), and known ones (H, W)."""
EXTRAPOLATION = 1 << COARSEST_AT_SILHOUETTES
"""Pixels by which surfaces extend past silhouettes, beyond any view: the widest cell of the mesh there."""
RISE = 0.5
"""Slope a pixel of a rising far surface, as a share of the least jump: diagonally half more and no jump."""


@dataclass(frozen=True)
class LayeredDepthImage:
    """Two surfaces on the same raster, which are equal away from silhouettes.

    Colours are linear and premultiplied, disparities in pixels at the aperture's rim.
    """

    front: LinearRGBA
    """(H, W, 4) the visible surface; in mixed pixels the near surface's share and alpha."""
    front_disparity: Map
    """(H, W) disparity of the visible surface; in mixed pixels that of the near one."""
    near_disparity: Map
    """(H, W) disparity of the near surface, extrapolated past its silhouettes."""
    is_far: Mask
    """(H, W) pixels past a silhouette, where the far surface is visible."""
    mixed: Mask
    """(H, W) mixed pixels at silhouettes, which two surfaces share."""
    back: LinearRGBA
    """(H, W, 4) the far surface, opaque."""
    back_disparity: Map
    """(H, W) disparity of the far surface, extrapolated behind the near one."""
    disoccluded: Mask
    """(H, W) occluded pixels in which a view may see the far surface."""
    reprojected: Mask
    """(H, W) disoccluded pixels whose colour in `back` is from other frames."""
    occluded: Mask
    """(H, W) pixels in which the far surface is extrapolated behind the near one."""
    jump: float
    """Pixels of disparity above which neighbours are cut."""


def depth_peel(
    picture: LinearRGBA,
    disparity: Map,
    jumps: tuple[float, ...],
    fill: Fill | None = None,
    opacity: Map | None = None,
    far: Map | None = None,
) -> tuple[LayeredDepthImage, ...]:
    """Split a picture at the jumps of its disparity, the largest first.

    After each split, the far surface is split again at smaller jumps: where one silhouette crosses another
    there are three surfaces. Splits without effect are left out, except the last. Everitt, "Interactive
    order-independent transparency", 2001, peels surfaces in the same order.

    Args:
        picture: (H, W, 4).
        disparity: (H, W).
        jumps: In pixels, descending.
        fill: Returns hidden colours.
        opacity: (H, W) in [0, 1] of the front surface by a matte, NaN elsewhere.
        far: (H, W) disparity of the background, NaN where it is unknown.
    """
    found: list[LayeredDepthImage] = []
    for jump in jumps:
        layers = split(picture, disparity, jump, min(jumps), fill, opacity, far)
        if layers.mixed.any() or (jump == jumps[-1] and not found):
            found.append(layers)
            picture, disparity = layers.back, layers.back_disparity
    return tuple(found)


def split(
    picture: LinearRGBA,
    disparity: Map,
    jump: float,
    least: float,
    fill: Fill | None = None,
    opacity: Map | None = None,
    far: Map | None = None,
) -> LayeredDepthImage:
    """Split a picture (H, W, 4) in two where its disparity (H, W) jumps by more than `jump` pixels.

    Jumps of more than `least` end the extrapolation behind the same surface: they are left for later. `fill`
    returns other frames' colours of disoccluded pixels. `opacity` and `far` are those of `depth_peel`; a
    fraction is alpha, and both surfaces are visible.
    """
    near_side, far_side = _silhouettes(disparity, jump)
    mixed = near_side | far_side
    checkpoint(0.2)
    surfaces = surfaces_beside(picture, disparity, mixed, jump)
    checkpoint(0.3)
    others = np.zeros_like(mixed)
    if least < jump:
        others = _silhouettes(disparity, least)[0] & ~mixed
    away = _distance_along_surface(disparity, others, jump)
    matte = None if opacity is None else _matte(opacity, disparity, surfaces, jump)
    sheer = np.zeros_like(mixed) if matte is None else matte < 1
    beyond = _extrapolated(disparity, surfaces, jump, least, away, sheer, far)
    sheer &= beyond.occluded | mixed
    checkpoint(0.4)
    colour = _colour(picture)
    reprojected = np.zeros(disparity.shape, bool)
    if fill is not None:
        seen, known = fill(beyond.far, beyond.disoccluded | mixed)
        surfaces = with_reprojected(surfaces, picture[mixed, :3], seen[mixed], known[mixed])
        reprojected = known & (beyond.disoccluded | sheer)
        colour[reprojected] = seen[reprojected]
    checkpoint(0.5)
    front, front_disparity = picture.copy(), disparity.copy()
    alpha, front[mixed, :3], beside = matted(picture[mixed, :3], surfaces)
    colour[mixed] = np.where((sheer & reprojected)[mixed, None], colour[mixed], beside)
    front[mixed, 3], front_disparity[mixed] = alpha, surfaces.near_disparity
    known = ~(beyond.occluded | sheer) | reprojected
    if opacity is not None and matte is not None and sheer.any():
        # If the near surface is sheer, the pixel itself gives the colour behind.
        through = sheer & ~reprojected & (matte < MOST_THROUGH)
        near = inpainted(_colour(picture), opacity >= 1 - FAINTEST)
        colour[through] = behind(picture[through, :3], matte[through], near[through])
        known |= through
        shown = sheer & reprojected
        colour[shown] = corrected(picture[shown, :3], matte[shown], near[shown], colour[shown])
    colour = inpainted(colour, known)
    if matte is not None:
        front[sheer, 3] = matte[sheer]
        front[sheer, :3], colour[sheer] = parted(picture[sheer, :3], matte[sheer], colour[sheer])
    checkpoint(0.5)
    back = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2RGBA), np.float32)
    return LayeredDepthImage(
        front, front_disparity, beyond.near, beyond.is_far, mixed,
        back, beyond.far, beyond.disoccluded, reprojected,
        beyond.occluded, jump,
    )  # fmt: skip


def _matte(opacity: Map, disparity: Map, surfaces: Surfaces, jump: float) -> Map:
    """Return (H, W) alpha of the near surface around a matte's fractional opacity (H, W); NaN elsewhere."""
    covered = opacity > FAINTEST
    if not covered.any():
        return np.full(opacity.shape, np.nan, np.float32)
    fraction = covered & (opacity < 1 - FAINTEST)
    around = cv2.dilate(fraction.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    near = disparity.copy()
    near[surfaces.row, surfaces.column] = surfaces.near_disparity
    own, _ = of_nearest(disparity, covered)
    return np.where(around & (np.abs(near - own) <= jump), opacity, np.float32(np.nan))


def _silhouettes(disparity: Map, jump: float) -> tuple[Mask, Mask]:
    """Mark (H, W) pixels on the near and on the far side of jumps, corners included."""
    kernel = np.ones((3, 3), np.uint8)
    low, high = (np.asarray(f(disparity, kernel)) for f in (cv2.erode, cv2.dilate))
    return disparity - low > jump, high - disparity > jump


@dataclass(frozen=True)
class _Extrapolated:
    """Both surfaces of a silhouette, extrapolated past it."""

    near: Map
    """(H, W) disparity of the near surface."""
    far: Map
    """(H, W) disparity of the far surface."""
    is_far: Mask
    """(H, W) pixels of the far surface over which the near one is extrapolated."""
    occluded: Mask
    """(H, W) pixels of the near surface behind which the far one is extrapolated."""
    disoccluded: Mask
    """(H, W) pixels of the near surface behind which a view may see the far one."""


def _distance_along_surface(disparity: Map, others: Mask, jump: float) -> Map:
    """Return (H, W) distances in pixels to the mask `others`, infinite if it lies on another surface."""
    if not others.any():
        return np.full(disparity.shape, np.inf, np.float32)
    level, distance = of_nearest(disparity, others)
    return np.where(np.abs(disparity - level) <= jump, distance, np.inf)


def _extrapolated(
    disparity: Map, surfaces: Surfaces, jump: float, least: float, away: Map, sheer: Mask, known: Map | None
) -> _Extrapolated:
    """Extrapolate the surfaces of the nearest silhouettes, up to `away` (H, W) if not behind `sheer`."""
    seeds = np.zeros(disparity.shape, bool)
    near, far = disparity.copy(), disparity.copy()
    if not len(surfaces.row):
        return _Extrapolated(near, far, seeds, seeds, seeds)
    at = surfaces.row, surfaces.column
    seeds[at], near[at], far[at] = True, surfaces.near_disparity, surfaces.far_disparity
    both, distance = of_nearest(np.dstack([near, far]), seeds)
    before, behind = both[..., 0], both[..., 1]
    checkpoint(0.4)
    gap, reach = disparity - behind, EXTRAPOLATION
    occluded = distance <= np.minimum(gap + 2 + reach, away)
    if sheer.any():
        occluded |= cv2.distanceTransform((~sheer).astype(np.uint8), cv2.DIST_L2, 5) <= reach
    occluded &= ~seeds & (gap > jump)
    is_far = ~seeds & ~occluded & (gap <= jump) & (before - disparity > jump) & (distance <= reach)
    far = np.where(occluded, behind, far)
    is_far &= ~_beside(disparity, occluded, jump)
    checkpoint(0.4)
    disoccluded = occluded & ((distance <= gap + 2) | sheer)
    far = _smoothed(far, occluded | seeds, occluded, jump)
    if known is not None:
        # A comparison with NaN is false.
        far = np.where(occluded & (disparity - known > jump), known, far)
    if least < jump:
        far = np.where(occluded, _rising(far, disparity, occluded, seeds, jump, RISE * least), far)
    checkpoint(0.4)
    near = _smoothed(np.where(is_far, before, near), is_far | seeds, is_far, jump)
    return _Extrapolated(near, far, is_far, occluded, disoccluded)


def _beside(disparity: Map, among: Mask, jump: float) -> Mask:
    """Mark (H, W) pixels with a neighbour in `among` (H, W) on the same surface, which would tear apart."""
    found = np.zeros(disparity.shape, bool)
    checkpoint(0.4)
    for filtered, nothing in ((cv2.dilate, -np.inf), (cv2.erode, np.inf)):
        of_others = filtered(np.where(among, disparity, nothing), np.ones((3, 3), np.uint8))
        found |= np.abs(of_others - disparity) <= jump
    return found


def _rising(behind: Map, disparity: Map, occluded: Mask, seeds: Mask, jump: float, slope: float) -> Map:
    """Raise the rim of a far surface to the near one by a slope, against false silhouettes."""
    highest = cv2.dilate(np.where(occluded, disparity, -np.inf), np.ones((3, 3), np.uint8))
    rim = ~occluded & ~seeds & np.isfinite(highest) & (disparity >= highest - jump)
    if not rim.any():
        return behind
    level, distance = of_nearest(disparity, rim)
    return np.asarray(np.maximum(behind, np.minimum(level, disparity) - slope * distance))


def _smoothed(disparity: Map, among: Mask, changed: Mask, jump: float) -> Map:
    """Replace extrapolated disparities (H, W) by the mean of their surroundings."""
    mean = cv2.blur(np.where(among, disparity, 0), (5, 5)) / np.maximum(
        cv2.blur(among.astype(np.float32), (5, 5)), 1e-9
    )
    return np.where(changed & (np.abs(mean - disparity) < jump), mean, disparity)


def _colour(picture: LinearRGBA) -> LinearRGB:
    """Drop the alpha of a picture (H, W, 4)."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGBA2RGB), np.float32)


def inpainted(colour: LinearRGB, known: Mask) -> LinearRGB:
    """Fill unknown colours (H, W, 3) smoothly from known ones (H, W), by push-pull.

    Grossman and Dally, "Point sample rendering", 1998.
    """
    if not known.any():
        return colour
    mask = known.astype(np.uint8)
    weight = known.astype(np.float32)
    levels = [(cv2.copyTo(colour, mask), weight)]
    while min(levels[-1][1].shape) > 1:
        checkpoint(0.5)
        size = tuple(-(-n // 2) for n in levels[-1][1].shape[::-1])
        levels.append(tuple(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in levels[-1]))
    total, weight = levels[-1]
    result = total / in_channels(np.maximum(weight, 1e-9), 3)
    for total, weight in reversed(levels[1:-1]):
        checkpoint(0.5)
        up = _resized(result, weight.shape)
        sure = in_channels(np.minimum(weight, 1), 3)
        own = np.where(sure > 0, total / in_channels(np.maximum(weight, 1e-9), 3), up)
        result = own * sure + up * (1 - sure)
    return np.asarray(cv2.copyTo(colour, mask, _resized(result, known.shape)), np.float32)


def _resized(colour: LinearRGB, shape: tuple[int, ...]) -> LinearRGB:
    """Resample a small picture's colours (h, w, c) linearly."""
    return np.asarray(cv2.resize(colour, shape[::-1], interpolation=cv2.INTER_LINEAR).reshape(*shape, -1))
