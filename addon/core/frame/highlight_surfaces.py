"""Surfaces that occlude a part of a highlight's disc.

The way from a highlight to the aperture is searched for surfaces as in Policarpo, Oliveira and Comba,
"Real-time relief mapping on arbitrary polygonal surfaces", 2005.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from ..base.arrays import Floats, Map
from ..optics.thin_lens import ThinLens
from ..warp.cg_layer import CGLayer
from ..warp.layer import Layer

NEARER = 1.0
"""Least displacement in pixels by which an occluder is nearer than a highlight: less is noise of depth, and
below the jump at which surfaces are cut."""
WIDTHS = 0.0, 1.0, 2.0, 4.0, 8.0
"""Widths in pixels of the blur of an occluder, as a part of a highlight is not a point; rounded down."""
LOOKED_AT = 1 << 20
"""Samples processed at once, in arrays of tens of megabytes."""
LONGEST = 1 << 10
"""Width of the maps for OpenCV."""
OUTSIDE = 1.15
"""Radii of the aperture within which occluders are searched: discs are wider by the highlight."""


class Surfaces:
    """The surfaces of a frame, on the raster of its layers."""

    def __init__(
        self, layers: Sequence[Layer], cg: Sequence[CGLayer], lens: ThinLens, size: tuple[int, int]
    ) -> None:
        """Prepare for a canvas of `size` (height, width), in the centre of the layers' raster."""
        shown = [(each.disparity, each.alpha, each.jump) for each in layers]
        raster = shown[0][1].shape
        margin = (raster[0] - size[0]) // 2, (raster[1] - size[1]) // 2
        for each in cg:
            alone = each.on_raster(margin, raster)
            # Their alpha holds their silhouettes.
            shown.append((alone.displacement(lens), alone.picture[..., 3], np.inf))
        self._surfaces = [(lens.snap_displacement(d), _Blurred(a), j) for d, a, j in shown]
        self._nearest = np.max(
            [np.where(a.sharp > 0, d, -np.inf) for d, a, _ in self._surfaces], axis=0
        )  # fmt: skip
        self._least = max(NEARER, layers[-1].jump)
        self._corner = np.array([(n - own) // 2 for n, own in zip(self._nearest.shape, size, strict=True)])
        self._focal = lens.pinhole.focal / lens.pinhole.fx

    def transmittance(
        self, displacement: float, steps: Floats, places: Floats, widths: Floats, ways: Floats
    ) -> Floats:
        """Return the share (n,) of a highlight's light that passes nearer surfaces.

        Args:
            displacement: That of the highlight, in pixels.
            steps: (s,) displacements by which surfaces are nearer.
            places: (n, 2) positions of the highlight's parts, in pixels.
            widths: (n,) of the parts, in pixels.
            ways: (n, 2) positions on the aperture, in shares of its radius.
        """
        way = ways * self._focal
        count = -(-len(steps) * len(way) // LOOKED_AT)
        some = np.array_split(np.arange(len(way)), count)
        return np.concatenate(
            [self._along(displacement, steps, places[each], widths[each], way[each]) for each in some]
        )

    def _along(
        self, displacement: float, steps: Floats, places: Floats, widths: Floats, way: Floats
    ) -> Floats:
        """Return the share (n,) of light along ways (n, 2), in pixels a pixel of displacement."""
        # A surface nearer by t occludes the highlight from p if the frame sees it at place + t p.
        along = (self._on_raster(places) + steps[:, None, None] * way).astype(np.float32)
        passed = np.ones(len(way))
        for disparity, alpha, jump in self._surfaces:
            at = _sampled(disparity, along, cv2.INTER_NEAREST)
            over = at - displacement - steps[:, None].astype(np.float32)
            # The way passes through the surface, which is connected there.
            crossed = (over[:-1] > 0) & (over[1:] <= 0) & (np.abs(np.diff(at, axis=0)) <= jump)
            crossed &= np.diff(steps)[:, None] <= 1
            step, which = np.nonzero(crossed)
            if not len(step):
                continue
            before, behind = over[step, which], over[step + 1, which]
            share = (before / (before - behind))[:, None]
            met = along[step, which] + share * (along[step + 1, which] - along[step, which])
            # Across the highlight, other points of it are behind the same pixel.
            blur = widths[which] * np.abs(1 + (steps[step] + share[:, 0]) / displacement)
            levels = np.searchsorted(WIDTHS, blur, "right") - 1
            left = np.ones(len(way))
            for level in np.unique(levels):
                some = levels == level
                values = _sampled(alpha.by(int(level)), met[some], cv2.INTER_LINEAR)
                np.minimum.at(left, which[some], 1 - values)
            passed *= left
        return passed

    def _on_raster(self, places: Floats) -> Floats:
        """Convert positions in pixels to columns and rows (..., 2), whole numbers at pixel centres."""
        return np.asarray(places + self._corner[::-1] - 0.5)

    def steps(self, place: Floats, size: int, displacement: float) -> Floats:
        """Find the displacements by which occluders of a highlight may be nearer.

        Args:
            place: (2,) x and y of its centre, in pixels of the canvas.
            size: Its longer side in pixels.
            displacement: Pixels at the aperture's rim, relative to the focal plane.

        Returns:
            (n,) increasing whole pixels of displacement around those of the surfaces; empty without any.
        """
        farthest = OUTSIDE * max(0.0, float(self._nearest.max()) - displacement)
        if farthest < self._least:
            return np.zeros(0)
        wide = size / 2
        x0, y0 = self._on_raster(place)
        low = [max(0, int(n - wide - farthest)) for n in (y0, x0)]
        high = [int(n + wide + farthest) + 2 for n in (y0, x0)]
        part = self._nearest[low[0] : high[0], low[1] : high[1]]
        nearer = part - displacement
        row, column = np.nonzero(nearer >= self._least)
        nearer = nearer[row, column]
        away = np.hypot(row + low[0] - y0, column + low[1] - x0)
        nearer = nearer[OUTSIDE * nearer >= away - wide - 1]
        whole = np.unique(np.floor(nearer).astype(int))
        return np.unique(np.concatenate([whole - 1, whole, whole + 1, whole + 2])).astype(np.float64)


class _Blurred:
    """Opacities (H, W), blurred by each of `WIDTHS` on demand."""

    def __init__(self, alpha: Map) -> None:
        self.sharp = np.ascontiguousarray(alpha)
        self._wider = {0: self.sharp}

    def by(self, level: int) -> Map:
        """Return the opacities blurred by one of `WIDTHS`."""
        if level not in self._wider:
            blurred = cv2.GaussianBlur(self.sharp, (0, 0), WIDTHS[level] / np.sqrt(12))
            self._wider[level] = np.asarray(blurred, np.float32)
        return self._wider[level]


def _sampled(values: Map, at: Map, interpolation: int) -> Map:
    """Sample a raster (H, W) at columns and rows (..., 2), repeated past its border."""
    count = int(np.prod(at.shape[:-1]))
    # OpenCV accepts less than 32,768 pixels a side.
    places = np.zeros((-(-count // LONGEST) * LONGEST, 2), np.float32)
    places[:count] = at.reshape(-1, 2)
    if not count:
        return np.zeros(at.shape[:-1], np.float32)
    found = cv2.remap(
        values, places.reshape(-1, LONGEST, 2), None, interpolation, borderMode=cv2.BORDER_REPLICATE  # type: ignore[call-overload]
    )  # fmt: skip
    return np.asarray(found).ravel()[:count].reshape(at.shape[:-1])
