"""A frame as surfaces before each other: what the actual camera sees, and what lies behind its silhouettes.

Depths are given as displacements: how many pixels a virtual camera at the rim of the aperture sees a pixel
beside its place, relative to infinity. So a bound in pixels means the same for any scene and aperture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.progress import checkpoint
from ..camera.reconstruction import Floats

Mask = NDArray[np.bool_]
Picture = NDArray[np.float32]
Fill = Callable[[Floats, Mask], tuple[Picture, Mask]]
"""Colours (H, W, 3) of a surface of displacements (H, W) where a mask asks for them, and where they are."""

JUMP = 1.0
"""Pixels; neighbours that are displaced farther apart are not connected, unless the caller says so."""
REACH = 3
"""Pixels around a mixed one in which its two surfaces are looked for."""
SPREAD = 4.0
"""How much more the colours of a surface vary across a silhouette than beside it: variances."""
FEWEST = 6
"""Pixels that something thin must have near each other to be one."""
LONG = 7
"""Pixels along something thin from which its colour is taken."""
ON = 16
"""Pixels by which surfaces are carried on past a silhouette, more than a view sees of them."""
LEAST = 32
"""Pixels of a silhouette that is left for later; fewer are noise."""
RISE = 0.5
"""Of the least jump, by which a far surface may rise from a pixel to the next: diagonally it is half more."""
WORSE = 0.05
"""Distance from that line, by which what other frames tell may explain a pixel worse than what is beside."""
CONTRAST = 0.02
"""Distance of two colours (linear light) from which on they tell how a pixel is shared."""


@dataclass(frozen=True)
class LayeredDepthImage:
    """Two surfaces on the same raster; where there is no silhouette around they are the same one.

    Colours are linear and premultiplied.
    """

    front: Picture
    """(H, W, 4) what the actual camera sees; a silhouette's pixels have their share of the near surface."""
    front_shift: Floats
    """(H, W) displacement in pixels, a silhouette's pixels on the near surface."""
    near_shift: Floats
    """(H, W) the near surface's, carried on past its silhouettes."""
    is_far: Mask
    """(H, W) pixels past a silhouette: the near surface is not there, and the far one is seen."""
    mixed: Mask
    """(H, W) the silhouettes' pixels."""
    back: Picture
    """(H, W, 4) the far surface where there are two."""
    back_shift: Floats
    """(H, W) the far surface's, carried on behind the near one."""
    hidden: Mask
    """(H, W) where a view may see something behind the near surface."""
    borrowed: Mask
    """(H, W) of these, where its colour comes from other frames."""
    beneath: Mask
    """(H, W) where the far surface is carried on behind the near one: what is hidden, and some beside it."""
    jump: float
    """By how much more than this depths jump at the silhouettes."""
    hidden_colours: Mask | None = None
    """(H, W) past the frame's border, where the colour of what is seen comes from other frames."""


def peeled(
    picture: Picture, shift: Floats, fill: Fill | None = None, jumps: tuple[float, ...] = (JUMP,)
) -> tuple[LayeredDepthImage, ...]:
    """Take a picture (H, W, 4) with displacements (H, W) apart where they jump by more than the first of
    `jumps`, which fall, then what is left without the near surfaces at the next: where a silhouette crosses
    another one there are three surfaces. Splits that find nothing are left out, but for the last.
    """
    found: list[LayeredDepthImage] = []
    for jump in jumps:
        split = layered(picture, shift, fill, jump, min(jumps))
        if split.mixed.any() or (jump == jumps[-1] and not found):
            found.append(split)
            picture, shift = split.back, split.back_shift
    return tuple(found)


def layered(
    picture: Picture,
    shift: Floats,
    fill: Fill | None = None,
    jump: float = JUMP,
    least: float | None = None,
) -> LayeredDepthImage:
    """Take a picture (H, W, 4) with displacements (H, W) apart where they jump by more than `jump`.

    Jumps of more than `least` end what is carried on behind the same surface: they are left for later.
    """
    shift = _steep(shift, jump)
    near, far = _sides(shift, jump)
    band = near | far
    checkpoint(0.2)
    around = _around(picture, shift, band, jump)
    checkpoint(0.3)
    least = jump if least is None else least
    others = _long(_sides(shift, least)[0] & ~band) if least < jump else np.zeros_like(band)
    carried = _carried(shift, around, jump, least, _away(shift, others, jump))
    checkpoint(0.4)
    colour = picture[..., :3].copy()
    borrowed = np.zeros(shift.shape, bool)
    if fill is not None:
        seen, hidden_colours = fill(carried.far, carried.hidden | band)
        around = _told(around, picture[band, :3], seen[band], hidden_colours[band])
        borrowed = hidden_colours & carried.hidden
        colour[borrowed] = seen[borrowed]
    checkpoint(0.5)
    front, front_shift = picture.copy(), shift.copy()
    alpha, front[band, :3], colour[band] = _shared(picture[band, :3], around)
    front[band, 3], front_shift[band] = alpha, around.near_shift
    colour = inpainted(colour, ~carried.beneath | borrowed)
    checkpoint(0.5)
    opaque = np.ones((*shift.shape, 1), np.float32)
    return LayeredDepthImage(
        front, front_shift, carried.near, carried.is_far, band,
        np.concatenate([colour, opaque], axis=2), carried.far, carried.hidden, borrowed,
        carried.beneath, jump,
    )  # fmt: skip


def _steep(shift: Floats, jump: float) -> Floats:
    """Without single pixels half way up a jump, which belong to neither surface: they join the nearer one."""
    for axis in (0, 1):
        checkpoint(0.2)
        before, after = np.roll(shift, 1, axis), np.roll(shift, -1, axis)
        up, down = shift - before, after - shift
        between = (np.abs(up) > jump) & (np.abs(down) > jump) & (np.sign(up) == np.sign(down))
        joined = np.where(np.abs(up) < np.abs(down), before, after)
        inner = np.zeros(shift.shape, bool)
        inner[1:-1, 1:-1] = True
        shift = np.where(between & inner, joined, shift)
    return shift


def _sides(shift: Floats, jump: float) -> tuple[Mask, Mask]:
    """Pixels (H, W) on the near side of a jump, and on the far side of one, corners included."""
    kernel = np.ones((3, 3), np.uint8)
    low, high = (np.asarray(f(shift, kernel), np.float64) for f in (cv2.erode, cv2.dilate))
    return shift - low > jump, high - shift > jump


@dataclass(frozen=True)
class _Around:
    """The two surfaces that share each of n pixels, as they are beside them."""

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    near: Floats
    """(n, 3) colours."""
    far: Floats
    vary: Floats
    """(n,) variances of these."""
    far_vary: Floats
    near_shift: Floats
    far_shift: Floats
    share: Floats
    """(n,) of the near one, as far as depth tells."""
    sure: Mask
    """(n,) whether there is a near one: of something thin, too few pixels may be near each other."""


def _around(picture: Picture, shift: Floats, band: Mask, jump: float) -> _Around:
    """What is beside the pixels of a band (H, W)."""
    row, column = np.nonzero(band)
    offset = np.arange(-REACH, REACH + 1)
    dy, dx = (part.ravel() for part in np.meshgrid(offset, offset, indexing="ij"))
    y = np.clip(row[:, None] + dy, 0, shift.shape[0] - 1)
    x = np.clip(column[:, None] + dx, 0, shift.shape[1] - 1)
    around, pure = shift[y, x], ~band[y, x]
    closest = (np.maximum(np.abs(dy), np.abs(dx)) <= 1) & np.ones_like(pure)
    high = np.max(around, axis=1, where=closest, initial=-np.inf)
    low = np.min(around, axis=1, where=closest, initial=np.inf)
    own = shift[row, column]
    middle = (high + low) / 2
    weight = 1.0 / (1.0 + dy**2 + dx**2)
    checkpoint(0.3)
    colours = picture[y, x, :3]
    checkpoint(0.3)
    is_near, is_far = around > middle[:, None], around <= middle[:, None]
    # What is nearer or farther still belongs to a third surface.
    is_near &= around <= high[:, None] + jump
    is_far &= around >= low[:, None] - jump
    checkpoint(0.3)
    near, near_shift, vary = _mean(colours, around, weight * (is_near & pure), weight * is_near, own, high)
    checkpoint(0.3)
    far, far_shift, far_vary = _mean(colours, around, weight * (is_far & pure), weight * is_far, own, low)
    checkpoint(0.3)
    thin = ~(is_near & pure).any(axis=1)
    near[thin], vary[thin], count = _thin(picture, shift, row[thin], column[thin], near_shift[thin], jump)
    sure = np.ones(len(row), bool)
    sure[thin] = count >= FEWEST
    # That something thin is there at all, only its colour tells.
    share = ((own > middle) & ~thin).astype(np.float64)
    return _Around(row, column, near, far, vary, far_vary, near_shift, far_shift, share, sure)


def _told(around: _Around, colour: Picture, far: Picture, known: Mask) -> _Around:
    """With the far surface's own colours (n, 3) where they are known (n,), and explain the pixels' colours
    (n, 3) as well as those beside."""

    def unexplained(far: Floats | Picture) -> Floats:
        share = np.clip(_share(colour, around.near, far), 0, 1)[:, None]
        return np.asarray(((colour - share * around.near - (1 - share) * far) ** 2).sum(axis=1))

    known = known & (unexplained(far) <= unexplained(around.far) + WORSE**2)
    told = np.where(known[:, None], far.astype(np.float64), around.far)
    return replace(around, far=told, far_vary=np.where(known, 0, around.far_vary))


def _share(colour: Picture, near: Floats, far: Floats | Picture) -> Floats:
    """(n,) where on the line from far to near colours (n, 3) others lie (n, 3)."""
    line = near - far
    return np.asarray(((colour - far) * line).sum(axis=1) / np.maximum((line**2).sum(axis=1), 1e-12))


def _shared(colour: Picture, around: _Around) -> tuple[Picture, Picture, Picture]:
    """How much of n pixels (n, 3) the near surface covers (n,), its premultiplied colour (n, 3), and the far
    one's.

    A pixel on the line between the colours of both surfaces beside it has its share by where it lies there.
    Whatever the share, both together are the pixel as it was.
    """
    far = around.far
    length = ((around.near - far) ** 2).sum(axis=1)
    share = _share(colour, around.near, far)
    # Where the surfaces look alike, or each of many colours, the depth alone tells.
    trust = length / (length + CONTRAST**2 + SPREAD * (around.vary + around.far_vary))
    alpha = np.clip(trust * share + (1 - trust) * around.share, 0, 1) * around.sure
    front = np.maximum(colour - (1 - alpha)[:, None] * far, 0)
    # Where the pixel is darker than the far surface's share alone, that is darker there, too.
    far = np.minimum(far, colour / np.maximum(1 - alpha, 1e-6)[:, None])
    return alpha.astype(np.float32), front.astype(np.float32), far.astype(np.float32)


def _thin(
    picture: Picture,
    shift: Floats,
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    near: Floats,
    jump: float,
) -> tuple[Floats, Floats, Floats]:
    """(n, 3) the colour of something so thin that no pixel is its own: the mean along it; (n,) how much it
    varies; (n,) of how many pixels.

    `near` (n,) is its displacement. A single pixel of it may show more of what is behind.
    """
    offset = np.arange(-LONG, LONG + 1)
    y = np.clip(row[:, None, None] + offset[:, None], 0, shift.shape[0] - 1)
    x = np.clip(column[:, None, None] + offset, 0, shift.shape[1] - 1)
    along = (np.abs(shift[y, x] - near[:, None, None]) < jump).astype(np.float32)
    checkpoint(0.3)
    colours = picture[y, x, :3]
    count = along.sum(axis=(1, 2))
    mean = np.einsum("nij,nijc->nc", along, colours) / np.maximum(count, 1)[:, None]
    spread = np.einsum("nij,nijc->n", along, colours**2) / np.maximum(count, 1) - (mean**2).sum(axis=1)
    return mean, np.maximum(spread, 0), count


def _mean(
    colours: Picture, shifts: Floats, pure: Floats, any_: Floats, own: Floats, otherwise: Floats
) -> tuple[Floats, Floats, Floats]:
    """(n, 3) and (n,) weighted means of the colours (n, k, 3) and shifts (n, k): of pure pixels, if there are
    any, else of those that there are; (n,) the variance of the colours."""
    weight = np.where(pure.any(axis=1)[:, None], pure, any_)
    total = weight.sum(axis=1)
    safe = np.maximum(total, 1e-12)[:, None]
    colour = np.einsum("nk,nkc->nc", weight, colours) / safe
    spread = np.einsum("nk,nkc->n", weight, colours**2) / safe[:, 0] - (colour**2).sum(axis=1)
    shift = np.where(total > 0, np.einsum("nk,nk->n", weight, shifts) / safe[:, 0], otherwise)
    return colour, shift, np.maximum(spread, 0)


@dataclass(frozen=True)
class _Carried:
    """Both surfaces of a silhouette carried on past it; arrays are (H, W)."""

    near: Floats
    far: Floats
    is_far: Mask
    """Pixels of the far surface that the near one was carried over."""
    beneath: Mask
    """Pixels of the near surface that the far one was carried behind."""
    hidden: Mask
    """Of these, where a view may see it."""


def _long(lines: Mask) -> Mask:
    """Of a mask (H, W), without its small pieces."""
    _, label, found, _ = cv2.connectedComponentsWithStats(lines.astype(np.uint8), connectivity=8)
    return np.asarray(lines & (found[:, cv2.CC_STAT_AREA] >= LEAST)[label])


def _away(shift: Floats, others: Mask, jump: float) -> Floats:
    """(H, W) pixels to the nearest of a mask (H, W), infinite where that lies on another surface."""
    if not others.any():
        return np.full(shift.shape, np.inf)
    distance, level = _of_nearest(others, shift)
    return np.where(np.abs(shift - level) <= jump, distance, np.inf)


def _of_nearest(seeds: Mask, values: Floats) -> tuple[NDArray[np.float32], Floats]:
    """(H, W) pixels to the nearest seed, and the values (..., H, W) of that one."""
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((*values.shape[:-2], int(label.max()) + 1))
    of_label[..., label[seeds]] = values[..., seeds]
    return np.asarray(distance, np.float32), of_label[..., label]


def _carried(shift: Floats, mixed: _Around, jump: float, least: float, away: Floats) -> _Carried:
    """The surfaces of the nearest silhouette at each pixel; `away` (H, W) is how far the others are."""
    seeds = np.zeros(shift.shape, bool)
    near, far = shift.copy(), shift.copy()
    if not len(mixed.row):
        return _Carried(near, far, seeds, seeds, seeds)
    seeds[mixed.row, mixed.column] = True
    near[mixed.row, mixed.column], far[mixed.row, mixed.column] = mixed.near_shift, mixed.far_shift
    distance, (on, behind) = _of_nearest(seeds, np.stack([near, far]))
    checkpoint(0.4)
    gap = shift - behind
    beneath = ~seeds & (gap > jump) & (distance <= np.minimum(gap + 2 + ON, away))
    is_far = ~seeds & ~beneath & (gap <= jump) & (on - shift > jump) & (distance <= ON)
    far = np.where(beneath, behind, far)
    is_far &= ~_beside(shift, beneath, jump)
    checkpoint(0.4)
    hidden = beneath & (distance <= gap + 2)
    far = _smoothed(far, beneath | seeds, beneath, jump)
    if least < jump:
        far = np.where(beneath, _rising(far, shift, beneath, seeds, jump, RISE * least), far)
    checkpoint(0.4)
    near = np.where(is_far, on, near)
    near = _smoothed(near, is_far | seeds, is_far, jump)
    return _Carried(near, far, is_far, beneath, hidden)


def _beside(shift: Floats, among: Mask, jump: float) -> Mask:
    """(H, W) pixels with a neighbour among others (H, W) on the same surface: it would tear between them."""
    found = np.zeros(shift.shape, bool)
    checkpoint(0.4)
    for filtered, nothing in ((cv2.dilate, -np.inf), (cv2.erode, np.inf)):
        of_others = filtered(np.where(among, shift, nothing), np.ones((3, 3), np.uint8))
        found |= np.abs(of_others - shift) <= jump
    return found


def _rising(behind: Floats, shift: Floats, beneath: Mask, seeds: Mask, jump: float, slope: float) -> Floats:
    """(H, W) a far surface that comes up to the near one, by `slope` a pixel, where it ends.

    A jump there would be taken for one more silhouette.
    """
    highest = cv2.dilate(np.where(beneath, shift, -np.inf), np.ones((3, 3), np.uint8))
    rim = ~beneath & ~seeds & np.isfinite(highest) & (shift >= highest - jump)
    if not rim.any():
        return behind
    distance, level = _of_nearest(rim, shift)
    return np.asarray(np.maximum(behind, np.minimum(level, shift) - slope * distance))


def _smoothed(shift: Floats, among: Mask, changed: Mask, jump: float) -> Floats:
    """Displacements (H, W), those that were carried on as the mean of what was around them."""
    mean = cv2.blur(np.where(among, shift, 0), (5, 5)) / np.maximum(
        cv2.blur(among.astype(np.float64), (5, 5)), 1e-9
    )
    return np.where(changed & (np.abs(mean - shift) < jump), mean, shift)


def inpainted(colour: Picture, known: Mask) -> Picture:
    """(H, W, 3) colours where they are known (H, W), elsewhere smoothly carried on: push and pull.

    Grossman and Dally, "Point sample rendering", 1998.
    """
    if not known.any():
        return colour
    weight = known.astype(np.float32)
    levels = [(colour * weight[..., None], weight)]
    while min(levels[-1][1].shape) > 1:
        checkpoint(0.5)
        size = tuple(-(-n // 2) for n in levels[-1][1].shape[::-1])
        levels.append(tuple(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in levels[-1]))
    total, weight = levels[-1]
    result = np.asarray(total / np.maximum(weight, 1e-9)[..., None], np.float32)
    for total, weight in reversed(levels[1:-1]):
        checkpoint(0.5)
        up = _enlarged(result, weight.shape)
        sure = np.minimum(weight, 1)[..., None]
        own = np.where(weight[..., None] > 0, total / np.maximum(weight, 1e-9)[..., None], up)
        result = np.asarray(own * sure + up * (1 - sure), np.float32)
    return np.where(known[..., None], colour, _enlarged(result, known.shape)).astype(np.float32)


def _enlarged(colour: Picture, shape: tuple[int, ...]) -> Picture:
    return np.asarray(cv2.resize(colour, shape[::-1], interpolation=cv2.INTER_LINEAR).reshape(*shape, -1))
