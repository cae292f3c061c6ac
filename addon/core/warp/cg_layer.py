"""CG objects as a layer of a frame, with alpha and depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Ints, LinearRGBA, Map
from ..base.nearest_fill import nearest
from ..camera.reconstruction import Intrinsics
from ..optics.thin_lens import ThinLens
from .footprint import prefilter_alone
from .layer import Layer
from .mesh import WarpMesh

FAINT = 1e-3
"""Largest alpha of an empty pixel: a quarter of an 8-bit step."""
SOLID = 0.5
"""Least alpha of a pixel with a reliable depth."""
STEP = 2
"""Pixels between vertices of the mesh. Chosen by inspection: round outlines stay round."""
Discs = Callable[[Map, Floats], Map]
"""Returns radii (h, w) in pixels of the blur discs of displacements (h, w) at pixels (h, w, 2)."""


def as_displaced(displacement: Map, _xy: Floats) -> Map:
    """Return the displacements: a lens without aberrations."""
    return displacement


@dataclass(frozen=True)
class CGLayer:
    """CG objects as the frame's camera sees them, without occlusion by the clip."""

    picture: LinearRGBA
    """(h, w, 4) linear, premultiplied."""
    inverse_depth: Map
    """(h, w) 1 / z in the frame's camera, in the reconstruction's unit; outside silhouettes, the nearest."""
    corner: tuple[int, int]
    """Column and row of the first pixel on the canvas; negative before the canvas."""
    is_sharp: bool = False
    """True if all views see it as the frame's camera does, so that no lens blurs it."""

    @classmethod
    def of(
        cls, picture: LinearRGBA, inverse_depth: Map, margin: int, typical: float, is_sharp: bool = False
    ) -> CGLayer | None:
        """Return the layer of a picture (H, W, 4) of the canvas and a margin in pixels; None if it is empty.

        `inverse_depth` (H, W) is 0 where the camera sees no surface; a layer without any, such as smoke, has
        the `typical` one.
        """
        covered = picture[..., 3] > FAINT
        if not covered.any():
            return None
        rows, columns = (np.nonzero(covered.any(axis=axis))[0][[0, -1]] for axis in (1, 0))
        part = slice(rows[0], rows[1] + 1), slice(columns[0], columns[1] + 1)
        inverse, known = inverse_depth[part], covered[part] & (inverse_depth[part] > 0)
        solid = known & (picture[part][..., 3] > SOLID)
        known = solid if solid.any() else known
        inverse = nearest(inverse, known) if known.any() else np.full_like(inverse, typical)
        return cls(picture[part].copy(), inverse, (int(columns[0]) - margin, int(rows[0]) - margin), is_sharp)

    def places(self) -> Floats:
        """Return (h, w, 2) centres of pixels on the canvas."""
        rows, columns = self.inverse_depth.shape
        across = np.arange(columns) + self.corner[0] + 0.5
        return np.stack(np.meshgrid(across, np.arange(rows) + self.corner[1] + 0.5), axis=-1)

    def displacement(self, lens: ThinLens) -> Map:
        """Return (h, w) displacements in pixels at the aperture's rim, relative to the focal plane."""
        rectified = lens.rectified(self.inverse_depth, self.places())
        return np.asarray(lens.displacement(np.asarray(rectified, np.float64)), np.float32)

    def scaled(self, before: Intrinsics, after: Intrinsics) -> CGLayer:
        """Resample for a canvas of another size with the same pinhole."""
        scale = after.focal / before.focal
        # Blurred before it shrinks, against aliasing; the blur extends past the border.
        cell = [2 * round(0.5 / each) + 1 if each < 1 else 1 for each in scale.tolist()]
        wide = self._padded(max(cell))
        picture = np.asarray(cv2.blur(wide.picture, cell, borderType=cv2.BORDER_CONSTANT), np.float32)
        first = (np.array(wide.corner) - before.principal_point) * scale + after.principal_point
        corner = np.floor(first).astype(int)
        size = np.ceil(first + scale * wide.inverse_depth.shape[::-1]).astype(int) - corner
        # From pixels of the result to pixels here; OpenCV counts from their centres.
        shift = (corner + 0.5 - first) / scale - 0.5
        matrix = np.array([[1 / scale[0], 0, shift[0]], [0, 1 / scale[1], shift[1]]])

        def at(values: Map, how: int, border: int) -> Map:
            flags = how | cv2.WARP_INVERSE_MAP
            found = cv2.warpAffine(values, matrix, size.tolist(), flags=flags, borderMode=border)
            return np.asarray(found, np.float32)

        return CGLayer(
            at(picture, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT),
            at(wide.inverse_depth, cv2.INTER_NEAREST, cv2.BORDER_REPLICATE),
            (int(corner[0]), int(corner[1])), self.is_sharp,
        )  # fmt: skip

    def on_raster(self, margin: tuple[int, int], shape: tuple[int, ...]) -> CGLayer:
        """Place on a raster of (rows, columns) that begins `margin` rows and columns before the canvas."""
        begin = self.corner[1] + margin[0], self.corner[0] + margin[1]
        spare = [
            (max(first, 0), max(whole - first - own, 0))
            for first, whole, own in zip(begin, shape, self.inverse_depth.shape, strict=False)
        ]
        rows, columns = (
            slice(max(-first, 0), max(-first, 0) + whole) for first, whole in zip(begin, shape, strict=False)
        )
        return CGLayer(
            np.pad(self.picture, [*spare, (0, 0)])[rows, columns],
            np.pad(self.inverse_depth, spare, mode="edge")[rows, columns],
            (-margin[1], -margin[0]), self.is_sharp,
        )  # fmt: skip

    def largest_disc(self, lens: ThinLens) -> float:
        """Return the 99th percentile of the covered pixels' blur discs: a diameter in pixels."""
        if self.is_sharp:
            return 0.0
        rectified = np.asarray(lens.rectified(self.inverse_depth, self.places()), np.float64)
        return lens.largest_disc(rectified[self.picture[..., 3] > FAINT])

    def layer(self, lens: ThinLens, views: int, spread: float, discs: Discs = as_displaced) -> Layer:
        """Return the layer that is drawn, prefiltered for a number of views through a lens.

        It reaches past the picture as far as the filter does. `spread` is the open part of the aperture, in
        shares of its radius.
        """

        def footprints(of: CGLayer) -> Map:
            return lens.footprint(discs(of.displacement(lens), of.places()), views)

        widest = 0.0 if self.is_sharp else spread * float(footprints(self).max())
        wide = self._padded(int(np.ceil(widest)) + 2)
        texture = wide.picture.copy()
        if not self.is_sharp:
            prefilter_alone(texture, np.float32(spread) * footprints(wide))
        texture[texture[..., 3] < FAINT] = 0
        away = lens.snap_displacement(wide.displacement(lens)).astype(np.float64)
        inverse = lens.focus + away / lens.disparity_scale
        rows, columns = (range(0, n, STEP) for n in inverse.shape)
        place = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2) + 0.5
        used, triangles = _used(_triangles(texture[..., 3] > 0))
        at = inverse[np.ix_(rows, columns)].ravel()[used]
        return Layer(WarpMesh(place[used] + wide.corner, place[used], at, triangles), texture, False)

    def _padded(self, margin: int) -> CGLayer:
        """Pad by at least `margin` empty pixels, to sides of a multiple of `STEP` plus one."""
        after = [margin + (1 - n - 2 * margin) % STEP for n in self.inverse_depth.shape]
        sides = [(margin, n) for n in after]
        return CGLayer(
            np.pad(self.picture, [*sides, (0, 0)]), np.pad(self.inverse_depth, sides, mode="edge"),
            (self.corner[0] - margin, self.corner[1] - margin), self.is_sharp,
        )  # fmt: skip


def _triangles(covered: np.ndarray) -> Ints:
    """Return (T, 3) triangles, two for each covered (H, W) cell of the raster of every `STEP`-th pixel."""
    height, width = ((n - 1) // STEP for n in covered.shape)
    cells = np.zeros((height, width), bool)
    for down in range(STEP + 1):
        for across in range(STEP + 1):
            cells |= covered[down::STEP, across::STEP][:height, :width]
    row, column = np.nonzero(cells)
    first = row * (width + 1) + column
    below = first + width + 1
    both = np.stack([first, below, first + 1, first + 1, below, below + 1], axis=1)
    return both.reshape(-1, 3).astype(np.int32)


def _used(triangles: Ints) -> tuple[Ints, Ints]:
    """Return the rows of the vertices in triangles (T, 3), and the triangles renumbered to them."""
    used, renamed = np.unique(triangles, return_inverse=True)
    return used.astype(np.int32), renamed.reshape(-1, 3).astype(np.int32)
