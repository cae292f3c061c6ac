"""Prefilter of a layered mesh's texture for the number of views.

Each of N views stands for an N-th of the aperture: between neighbouring views a texel moves by its footprint,
a disc of radius d / sqrt(N) for a displacement of d pixels at the aperture's rim. Blurred over a square with
the disc's variance, few views look like many, and surfaces in focus stay sharp. Levoy and Hanrahan, "Light
field rendering", 1996, prefilter over the aperture for the same reason; the footprint of a texture is
Heckbert's, "Fundamentals of texture mapping and image warping", 1989.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from ..base.arrays import LinearRGBA, Map, Mask, repeated
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side
from .layer import Layer

TILE = 64
"""Side of a tile in texels; each tile is blurred as widely as it needs."""
WIDEST = 256.0
"""Widest footprint in texels, wider than most displacements; wider ones are clamped."""


WIDTHS = (1, *(step * 2**octave - 1 for octave in range(1, 9) for step in (2, 3)))
"""Sides of squares in texels, a third to a half apart; blurs between them are interpolated. A square instead
of the disc changes a frame by less than 0.03 dB with 4 to 64 views (foreground, fence and rack, 24 px)."""
RADII = np.sqrt((np.square(WIDTHS) - 1) / 3).astype(np.float32)
"""Radii in texels of the discs with their variance."""


def prefilter(layers: Sequence[Layer], radius: Callable[[Map], Map]) -> None:
    """Blur the pictures of a frame's layers, near to far, in place.

    Near surfaces are blurred together with their alpha, as far as they are drawn; the last one stays opaque.
    No surface bleeds into another. Passes checkpoints.

    Args:
        layers: The layers.
        radius: Returns the footprints' radii (H, W) in pixels of disparities (H, W).
    """
    *fronts, last = layers
    # The background first: in buried places it uses the unblurred texels of the others.
    buried = [(each.picture, each.buried) for each in fronts]
    # Tiles read their unblurred neighbours.
    spare = np.empty_like(last.picture)
    _Part(last.picture, spare, np.asarray(radius(last.disparity), np.float32), buried=buried).blur()
    last.picture[..., 3] = 1
    for each in fronts:
        own = np.where(each.covered, radius(each.disparity), 0).astype(np.float32)
        _Part(each.picture, spare, own, each.covered).blur()


def prefilter_alone(texture: LinearRGBA, radius: Map) -> None:
    """Blur a texture (h, w, 4) and its alpha in place by radii (h, w) in texels; passes checkpoints."""
    _Part(texture, np.empty_like(texture), radius.astype(np.float32)).blur()


@dataclass(frozen=True)
class _Part:
    """A part of the texture, blurred tile by tile."""

    texels: LinearRGBA
    spare: LinearRGBA
    """(h, w, 4) memory for the result."""
    radius: Map
    """(H, W) radii of the footprints in pixels."""
    kept: Mask | None = None
    """(H, W) pixels whose texels are not empty; None for all."""
    buried: Sequence[tuple[LinearRGBA, Mask]] = ()
    """Other parts, whose texels replace its own as neighbours in pixels (H, W)."""

    @property
    def finer(self) -> int:
        """Texels a pixel along each axis."""
        return int(self.texels.shape[1] // self.radius.shape[1])

    def blur(self) -> None:
        """Blur in place."""
        rows, columns = (range(0, self.finer * n, TILE) for n in self.radius.shape)

        def in_row(row: int) -> list[slice]:
            return [slice(column, column + TILE) for column in columns if self._tile((row, column))]

        # By rows: to pass a single tile to a thread takes as long as a small one.
        for row, blurred in zip(rows, side_by_side(in_row, rows), strict=True):
            for tile in blurred:
                self.texels[row : row + TILE, tile] = self.spare[row : row + TILE, tile]

    def _tile(self, place: tuple[int, int]) -> bool:
        """Blur one tile into `spare`; returns False if it is unchanged."""
        own = self.radius[tuple(slice(n // self.finer, (n + TILE) // self.finer) for n in place)]
        if not own.any():
            return False
        checkpoint(0.95)
        own = np.minimum(self.finer * repeated(own, self.finer), WIDEST)
        # A radius is interpolated between those beside it, so others are not blurred.
        interval = np.searchsorted(RADII, own[own > 0]) - 1
        has = np.bincount(interval, minlength=len(WIDTHS)) > 0
        used = np.flatnonzero(has | np.roll(has, 1))
        margin = WIDTHS[used[-1]] // 2
        around = self._around(place, (own.shape[0], own.shape[1]), margin)
        inner = slice(margin, margin + own.shape[0]), slice(margin, margin + own.shape[1])
        rows, columns = (slice(n, n + size) for n, size in zip(place, own.shape, strict=True))
        tile = self.spare[rows, columns]
        tile[:] = cv2.blur(around, (WIDTHS[used[0]],) * 2)[inner]
        squared = own * own
        for below, level in pairwise(used):
            # Variances add up and grow with the squared radius, so interpolation is linear in it.
            share = (squared - RADII[below] ** 2) / (RADII[level] ** 2 - RADII[below] ** 2)
            more = cv2.blur(around, (WIDTHS[level],) * 2)[inner] - tile
            more *= cv2.merge([np.clip(share, 0, 1, out=share)] * 4)
            tile += more
        sharp = own == 0
        if sharp.any():
            tile[sharp] = self.texels[rows, columns][sharp]
        return True

    def _around(self, place: tuple[int, int], size: tuple[int, int], margin: int) -> LinearRGBA:
        """Return (h, w, 4) texels of a tile and `margin` around, repeated past the border."""
        low = [max(0, n - margin) for n in place]
        whole = self.texels.shape[:2]
        high = [min(most, n + own + margin) for most, n, own in zip(whole, place, size, strict=True)]
        texels = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        pixels = tuple(slice(a // self.finer, -(-b // self.finer)) for a, b in zip(low, high, strict=True))
        cut = tuple(slice(a % self.finer, a % self.finer + b - a) for a, b in zip(low, high, strict=True))
        found = self.texels[texels]
        if self.kept is not None and not self.kept[pixels].all():
            shown = repeated(self.kept[pixels].astype(np.uint8), self.finer)[cut]
            found = np.asarray(cv2.copyTo(found, np.ascontiguousarray(shown)), np.float32)
        for other, mask in self.buried:
            if mask[pixels].any():
                hidden = repeated(mask[pixels].astype(np.float32), self.finer)[cut] > 0
                opaque = other[texels][..., 3:] == 1
                found = np.where(hidden[..., None] & opaque, other[texels], found)
        top, left = (margin - (n - a) for n, a in zip(place, low, strict=True))
        bottom, right = (margin - (b - n - own) for b, n, own in zip(high, place, size, strict=True))
        if top or left or bottom or right:
            found = cv2.copyMakeBorder(found, top, bottom, left, right, cv2.BORDER_REPLICATE)
        return np.asarray(found, np.float32)
