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
"""Pixels; neighbours that differ by more in displacement are not connected."""
REACH = 3
"""Pixels around a mixed one in which its two surfaces are looked for."""
CONTRAST = 0.02
"""Distance of two colours (linear light) from which on they tell how a pixel is shared."""


@dataclass(frozen=True)
class Layers:
    """Both surfaces on the same raster; colours are linear and premultiplied."""

    front: Picture
    """(H, W, 4)"""
    front_shift: Floats
    """(H, W) displacement in pixels."""
    back: Picture
    """(H, W, 4)"""
    back_shift: Floats
    """(H, W)"""
    hidden: Mask
    """(H, W) where the back surface is needed at all."""
    borrowed: Mask
    """(H, W) of these, where its colour comes from other frames."""


def layered(picture: Picture, shift: Floats, fill: Fill | None = None) -> Layers:
    """Take a picture (H, W, 4) with displacements (H, W) apart at its depth jumps."""
    shift = _steep(shift)
    near, far = _sides(shift)
    mixed = _mixed(picture, shift, near | far)
    front, front_shift = picture.copy(), shift.copy()
    rows = mixed.row, mixed.column
    front[rows] = np.column_stack([mixed.front, mixed.alpha])
    front_shift[rows] = mixed.near_shift
    behind = _behind(picture, shift, front_shift, mixed)
    back_shift, hidden, known, colour = behind
    borrowed = np.zeros(shift.shape, bool)
    if fill is not None:
        asked = hidden & ~known
        seen, borrowed = fill(back_shift, asked)
        borrowed &= asked
        colour[borrowed] = seen[borrowed]
    # Elsewhere it is the front's: where the back surface comes up to it, either may be drawn.
    colour = np.where(hidden[..., None], inpainted(colour, known | borrowed), picture[..., :3])
    alpha = np.ones((*shift.shape, 1), np.float32)
    return Layers(front, front_shift, np.concatenate([colour, alpha], axis=2), back_shift, hidden, borrowed)


def _steep(shift: Floats) -> Floats:
    """Without single pixels half way up a jump, which belong to neither surface: they join the nearer one."""
    for axis in (0, 1):
        before, after = np.roll(shift, 1, axis), np.roll(shift, -1, axis)
        up, down = shift - before, after - shift
        between = (np.abs(up) > JUMP) & (np.abs(down) > JUMP) & (np.sign(up) == np.sign(down))
        joined = np.where(np.abs(up) < np.abs(down), before, after)
        inner = np.zeros(shift.shape, bool)
        inner[1:-1, 1:-1] = True
        shift = np.where(between & inner, joined, shift)
    return shift


def _sides(shift: Floats) -> tuple[Mask, Mask]:
    """Pixels (H, W) on the near side of a jump, and on the far side of one, corners included."""
    kernel = np.ones((3, 3), np.uint8)
    low, high = (np.asarray(f(shift, kernel), np.float64) for f in (cv2.erode, cv2.dilate))
    return shift - low > JUMP, high - shift > JUMP


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


def _mixed(picture: Picture, shift: Floats, band: Mask) -> _Mixed:
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
    is_near &= around <= high[:, None] + JUMP
    is_far &= around >= low[:, None] - JUMP
    near, near_shift = _mean(colours, around, weight * (is_near & pure), weight * is_near, own, high)
    far, far_shift = _mean(colours, around, weight * (is_far & pure), weight * is_far, own, low)
    colour = picture[row, column, :3]
    line = near - far
    length = (line**2).sum(axis=1)
    share = ((colour - far) * line).sum(axis=1) / np.maximum(length, 1e-12)
    # Where both surfaces look alike the depth alone tells.
    trust = length / (length + CONTRAST**2)
    alpha = np.clip(trust * share + (1 - trust) * (own > middle), 0, 1)
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


def _mean(
    colours: Picture, shifts: Floats, pure: Floats, any_: Floats, own: Floats, otherwise: Floats
) -> tuple[Floats, Floats]:
    """(n, 3) and (n,) weighted means of the colours (n, k, 3) and shifts (n, k): of pure pixels, if there are
    any, else of those that there are."""
    weight = np.where(pure.any(axis=1)[:, None], pure, any_)
    total = weight.sum(axis=1)
    safe = np.maximum(total, 1e-12)[:, None]
    colour = np.einsum("nk,nkc->nc", weight, colours) / safe
    shift = np.where(total > 0, np.einsum("nk,nk->n", weight, shifts) / safe[:, 0], otherwise)
    return colour, shift


def _behind(
    picture: Picture, shift: Floats, front_shift: Floats, mixed: _Mixed
) -> tuple[Floats, Mask, Mask, Picture]:
    """Displacements (H, W) of the far surface carried on behind the near one; where it can be seen at all;
    where its colour is known; and that colour (H, W, 3)."""
    seeds = np.zeros(shift.shape, bool)
    far, colour = shift.copy(), picture[..., :3].copy()
    seeds[mixed.row, mixed.column] = True
    far[mixed.row, mixed.column] = mixed.far_shift
    colour[mixed.row, mixed.column] = mixed.far
    if not seeds.any():
        return far, seeds, seeds, colour
    distance, label = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_label = np.zeros(int(label.max()) + 1)
    of_label[label[seeds]] = far[seeds]
    carried = of_label[label]
    gap = shift - carried
    beneath = ~seeds & (gap > JUMP) & (distance <= gap + 2)
    # The ring beside the gap on the far surface: its own colour, so that nothing opens between the two.
    ring = ~seeds & (np.abs(gap) <= JUMP) & (distance <= 2)
    far = np.where(beneath, carried, far)
    hidden = seeds | beneath | ring
    smooth = cv2.blur(np.where(hidden, far, 0), (5, 5)) / np.maximum(
        cv2.blur(hidden.astype(np.float64), (5, 5)), 1e-9
    )
    far = np.where(beneath & (np.abs(smooth - far) < JUMP), smooth, far)
    return far, hidden, hidden & ~beneath, colour


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
