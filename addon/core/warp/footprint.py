"""Prefilter of a layered mesh's texture for the number of views.

Each of N views stands for an N-th of the aperture: between neighbouring views a texel moves by its footprint,
a disc of radius d / sqrt(N) for a displacement of d pixels at the aperture's rim. Blurred over it, few views
look like many, and surfaces in focus stay sharp. Levoy and Hanrahan, "Light field rendering", 1996, prefilter
over the aperture for the same reason; the footprint of a texture is Heckbert's, "Fundamentals of texture
mapping and image warping", 1989.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import compress, pairwise

import cv2
import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map, Mask, repeated
from ..base.nearest_fill import of_nearest
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side
from .layer import Layer

TILE = 64
"""Side of a tile in texels, a multiple of all `Level.shrink`; each tile is blurred as widely as it needs."""
SUBSAMPLES = 32
"""Samples a texel of a disc's rim: its area is accurate to 0.3 %."""
BISECTIONS = 16
"""Steps that find a disc's radius, to a 50,000th."""
WIDEST = 256.0
"""Widest footprint in texels, wider than most displacements; wider ones are clamped."""


@dataclass(frozen=True)
class Level:
    """A blur radius; radii between levels are interpolated."""

    radius: float
    shrink: int
    """Texels a cell of the raster on which it is blurred."""


def _levels() -> tuple[Level, ...]:
    """Radii a half to a third apart, each on a raster with at most nine cells across."""
    octaves = 2.0 ** np.arange(int(np.log2(WIDEST)) + 1)
    radii = np.stack([octaves, 1.5 * octaves], axis=1).ravel().tolist()
    return Level(0.0, 1), *(Level(r, max(1, int(2 ** np.floor(np.log2(r / 2))))) for r in radii)


LEVELS = _levels()
RADII = np.array([level.radius for level in LEVELS], np.float32)


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
        _Part(each.picture, spare, own, each.covered | _goes_on(each)).blur()


def prefilter_alone(texture: LinearRGBA, radius: Map) -> None:
    """Blur a texture (h, w, 4) and its alpha in place by radii (h, w) in texels; passes checkpoints."""
    _Part(texture, np.empty_like(texture), radius.astype(np.float32)).blur()


def _goes_on(layer: Layer) -> Mask:
    """Mark (H, W) pixels past a near surface's triangles, where it is drawn as part of another surface."""
    if layer.covered.all() or not layer.covered.any():
        return layer.covered
    alpha, _ = of_nearest(layer.alpha, layer.covered)
    return alpha > 0.5


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
        # A radius is interpolated between the levels beside it, so others are not blurred.
        interval = np.searchsorted(RADII, own[own > 0]) - 1
        has = np.bincount(interval, minlength=len(LEVELS)) > 0
        used = list(compress(LEVELS, has | np.roll(has, 1)))
        # Cells of the coarsest raster in use, past the widest disc and the taps of interpolation.
        step = used[-1].shrink
        margin = step * int(np.ceil(used[-1].radius / step) + 2)
        around = self._around(place, (own.shape[0], own.shape[1]), margin)
        inner = slice(margin, margin + own.shape[0]), slice(margin, margin + own.shape[1])
        rows, columns = (slice(n, n + size) for n, size in zip(place, own.shape, strict=True))
        tile = self.spare[rows, columns]
        tile[:] = _blurred(around, used[0])[inner]
        squared = own * own
        for below, level in pairwise(used):
            # Variances add up and grow with the squared radius, so interpolation is linear in it.
            share = (squared - below.radius**2) / (level.radius**2 - below.radius**2)
            more = _blurred(around, level)[inner] - tile
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


def _blurred(around: LinearRGBA, level: Level) -> LinearRGBA:
    """Blur texels (h, w, 4) by a level's disc; those near the border are invalid."""
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
    # The mean of a cell and linear interpolation blur, too: by a twelfth and a sixth of a cell squared.
    left = np.sqrt((level.radius / level.shrink) ** 2 - 4 * (1 / 12 + 1 / 6))
    small = cv2.filter2D(small, -1, disc_kernel(float(left)), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(small, wide.shape[1::-1], interpolation=cv2.INTER_LINEAR)[:height, :width])


@lru_cache
def disc_kernel(radius: float) -> Map:
    """Return (k, k) weights, of sum 1, of a disc with a radius of 0.5 cells or more.

    They are the cells' shares of a smaller disc, so that their variance is that of the wanted disc.
    """
    low, high = 0.0, radius
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        shares = _shares(middle)
        spread = (shares.sum(axis=0) * (np.arange(len(shares)) - len(shares) // 2) ** 2).sum()
        low, high = (middle, high) if spread < radius**2 / 4 else (low, middle)
    return np.asarray(_shares(high), np.float32)


def _shares(radius: float) -> Floats:
    """Return (k, k) shares of a disc that lie in the cells around its centre; their sum is 1."""
    reach = max(0, int(np.ceil(radius - 0.5)))
    place = (np.arange(SUBSAMPLES * (2 * reach + 1)) + 0.5) / SUBSAMPLES - reach - 0.5
    inside = place[:, None] ** 2 + place**2 <= radius**2
    shares = inside.reshape(2 * reach + 1, SUBSAMPLES, 2 * reach + 1, SUBSAMPLES).mean(axis=(1, 3))
    return np.asarray(shares / max(shares.sum(), 1e-9))
