"""A frame as two surfaces: what the actual camera sees, and what lies behind its silhouettes.

Depths are given as displacements: how many pixels a virtual camera at the rim of the aperture sees a pixel
beside its place, relative to infinity. So a bound in pixels means the same for any scene and aperture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .reconstruction import Floats

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
CONTRAST = 0.02
"""Distance of two colours (linear light) from which on they tell how a pixel is shared."""


@dataclass(frozen=True)
class Layers:
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
    lent: Mask | None = None
    """(H, W) past the frame's border, where the colour of what is seen comes from other frames."""


def layered(picture: Picture, shift: Floats, fill: Fill | None = None, jump: float = JUMP) -> Layers:
    """Take a picture (H, W, 4) with displacements (H, W) apart where they jump by more than `jump`."""
    shift = _steep(shift, jump)
    near, far = _sides(shift, jump)
    mixed = _mixed(picture, shift, near | far, jump)
    front, front_shift = picture.copy(), shift.copy()
    rows = mixed.row, mixed.column
    front[rows] = np.column_stack([mixed.front, mixed.alpha])
    front_shift[rows] = mixed.near_shift
    carried = _carried(shift, mixed, jump)
    colour = picture[..., :3].copy()
    colour[rows] = mixed.far
    borrowed = np.zeros(shift.shape, bool)
    if fill is not None:
        seen, borrowed = fill(carried.far, carried.hidden)
        borrowed &= carried.hidden
        colour[borrowed] = seen[borrowed]
    colour = inpainted(colour, ~carried.beneath | borrowed)
    alpha = np.ones((*shift.shape, 1), np.float32)
    band = np.zeros(shift.shape, bool)
    band[rows] = True
    return Layers(
        front, front_shift, carried.near, carried.is_far, band,
        np.concatenate([colour, alpha], axis=2), carried.far, carried.hidden, borrowed,
        carried.beneath,
    )  # fmt: skip


def _steep(shift: Floats, jump: float) -> Floats:
    """Without single pixels half way up a jump, which belong to neither surface: they join the nearer one."""
    for axis in (0, 1):
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
class _Mixed:
    """Pixels that a near and a far surface share, n of them."""

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    alpha: Picture
    """(n,) share of the near one."""
    front: Picture
    """(n, 3) its premultiplied colour."""
    far: Picture
    """(n, 3) the far one's colour."""
    near_shift: Floats
    far_shift: Floats


def _mixed(picture: Picture, shift: Floats, band: Mask, jump: float) -> _Mixed:
    """How much of each pixel of a band (H, W) the near surface covers.

    A pixel on the line between the colours of both surfaces beside it has its share by where it lies there.
    Whatever the share, both together are the pixel as it was.
    """
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
    colours = picture[y, x, :3]
    is_near, is_far = around > middle[:, None], around <= middle[:, None]
    # What is nearer or farther still belongs to a third surface.
    is_near &= around <= high[:, None] + jump
    is_far &= around >= low[:, None] - jump
    near, near_shift, vary = _mean(colours, around, weight * (is_near & pure), weight * is_near, own, high)
    far, far_shift, far_vary = _mean(colours, around, weight * (is_far & pure), weight * is_far, own, low)
    colour = picture[row, column, :3]
    thin = ~(is_near & pure).any(axis=1)
    near[thin], vary[thin], count = _thin(picture, shift, row[thin], column[thin], near_shift[thin], jump)
    line = near - far
    length = (line**2).sum(axis=1)
    share = ((colour - far) * line).sum(axis=1) / np.maximum(length, 1e-12)
    # Where the surfaces look alike, or each of many colours, the depth alone tells; but that something thin
    # is there at all, only its colour.
    trust = length / (length + CONTRAST**2 + SPREAD * (vary + far_vary))
    alpha = np.clip(trust * share + (1 - trust) * ((own > middle) & ~thin), 0, 1)
    alpha[thin] *= count >= FEWEST
    front = np.maximum(colour - (1 - alpha)[:, None] * far, 0)
    # Where the pixel is darker than the far surface's share alone, that is darker there, too.
    far = np.minimum(far, colour / np.maximum(1 - alpha, 1e-6)[:, None])
    return _Mixed(
        row,
        column,
        alpha.astype(np.float32),
        front.astype(np.float32),
        far.astype(np.float32),
        near_shift,
        far_shift,
    )


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


def _carried(shift: Floats, mixed: _Mixed, jump: float) -> _Carried:
    """The surfaces of the nearest silhouette at each pixel."""
    seeds = np.zeros(shift.shape, bool)
    near, far = shift.copy(), shift.copy()
    if not len(mixed.row):
        return _Carried(near, far, seeds, seeds, seeds)
    seeds[mixed.row, mixed.column] = True
    near[mixed.row, mixed.column], far[mixed.row, mixed.column] = mixed.near_shift, mixed.far_shift
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros((2, int(label.max()) + 1))
    of_label[:, label[seeds]] = near[seeds], far[seeds]
    on, behind = of_label[:, label]
    gap = shift - behind
    # A little farther than it is seen: there the far surface may come up to the near one.
    beneath = ~seeds & (gap > jump) & (distance <= gap + 2 + ON)
    is_far = ~seeds & ~beneath & (gap <= jump) & (on - shift > jump) & (distance <= ON)
    far = np.where(beneath, behind, far)
    hidden = beneath & (distance <= gap + 2)
    far = _smoothed(far, beneath | seeds, beneath, jump)
    near = np.where(is_far, on, near)
    near = _smoothed(near, is_far | seeds, is_far, jump)
    return _Carried(near, far, is_far, beneath, hidden)


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
        size = tuple(-(-n // 2) for n in levels[-1][1].shape[::-1])
        levels.append(tuple(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in levels[-1]))
    total, weight = levels[-1]
    result = total / np.maximum(weight, 1e-9)[..., None]
    for total, weight in reversed(levels[:-1]):
        up = cv2.resize(result, weight.shape[::-1], interpolation=cv2.INTER_LINEAR).reshape(total.shape)
        sure = np.minimum(weight, 1)[..., None]
        result = np.where(
            weight[..., None] > 0, total / np.maximum(weight, 1e-9)[..., None], up
        ) * sure + up * (1 - sure)
    return np.where(known[..., None], colour, result).astype(np.float32)
