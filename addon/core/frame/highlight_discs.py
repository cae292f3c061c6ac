"""Small highlights drawn as discs with the aperture's shape and their energy.

Few views draw a small highlight as a pattern of copies. So its light is removed from the picture before that
is painted on a mesh (`without_small_highlights`), and its disc is added to the mean of the views
(`HighlightDiscs.light`), at a cost that does not depend on their number: Potmesil and Chakravarty, "Synthetic
image generation with a lens and aperture camera model", 1982, spread every pixel in this way. Nearer surfaces
clip the disc as they clip the views (`highlight_surfaces.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import cv2
import numpy as np

from ..base.arrays import Floats, Ints, LinearRGB, LinearRGBA, Map, Mask
from ..base.nearest_fill import of_nearest
from ..base.progress import checkpoint
from ..optics.aberrations import scattered
from ..optics.aperture import RED_AND_BLUE, SUBSAMPLES, Aperture
from ..optics.bokeh import barrel_share, matte_box_share
from ..optics.thin_lens import ThinLens
from ..warp.cg_layer import CGLayer
from ..warp.clipped_blobs import brightest
from ..warp.layer import Layer
from ..warp.layered_depth_image import inpainted
from .highlight_surfaces import NEARER, Surfaces
from .steadied import Steadied
from .views import Views
from .vignetting import barrel_shift, light_left, matte_box_shift

WHITE = 1.02
"""Linear light, relative to white, above which a pixel belongs to a highlight: resampling rings by less."""
BRIGHT = 1.5
"""Least linear light of a highlight's brightest pixel: copies of less are invisible. Chosen by inspection."""
WIDER = 1.0
"""Least ratio of a disc's width to its highlight's. With 4, 1.5, 1, 0.5 and 0.2, bars (32 px, true depth) has
33.7, 34.3, 35.2, 35.2 and 35.2 dB."""
MOST = 400
"""Most highlights, the brightest: 341 with discs of 24 pixels take 0.5 to 0.8 CPU s (a scratch script)."""
RIM = 3
"""Pixels around a highlight that give light, too: the reach of optics and resampling."""
FINEST = 8
"""Steps a pixel of the radii of discs: brightness is accurate to 0.8 % at 16 pixels."""
BENT = 2
"""Rays a pixel along a disc with aberrations, which are scattered bilinearly. Discs are smaller than the
square that they are sampled on, so at least one falls on each of their pixels."""
LEAST_RADIUS = 0.5
"""Least radius of a disc in pixels: a smaller one has no visible shape."""
PARTS = 8
"""Most parts along each side of a partly occluded highlight. With 1, 4, 6, 8 and 16, bars (32 px, true depth)
has 34.4, 35.2, 35.3, 35.35 and 35.36 dB."""
CHANNELS = 126
"""Channels that OpenCV 5 filters at once, at most 128."""


@dataclass(frozen=True)
class SmallHighlight:
    """A small highlight of the canvas's picture."""

    corner: tuple[int, int]
    """Row and column of its patch."""
    light: LinearRGB
    """(h, w, 3) light above its surroundings."""
    displacement: float
    """Pixels at the aperture's rim, relative to the focal plane; negative behind it."""

    @property
    def place(self) -> Floats:
        """(2,) x and y of the centre of its light, in pixels."""
        return np.asarray(_middles(self.light[None])[0] + self.corner[::-1])

    def parts(self, most: int) -> tuple[LinearRGB, Ints]:
        """Divide its light into at most `most` parts across and down, of at least a pixel.

        Returns:
            Light (n, s, s, 3), and the parts' first rows and columns (n, 2) in the picture.
        """
        size = -(-max(self.light.shape[:2]) // most)
        count = [-(-side // size) for side in self.light.shape[:2]]
        spare = [(0, n * size - side) for n, side in zip(count, self.light.shape[:2], strict=True)]
        cells = np.pad(self.light, (*spare, (0, 0))).reshape(count[0], size, count[1], size, 3)
        found = cells.swapaxes(1, 2).reshape(-1, size, size, 3)
        corner = np.indices(count).reshape(2, -1).T * size + self.corner
        lit = found.any(axis=(1, 2, 3))
        return found[lit], corner[lit].astype(np.int32)


def _middles(light: LinearRGB) -> Floats:
    """Return (n, 2) x and y of the centres of light of patches (n, h, w, 3), in pixels from their corners."""
    energy = light.sum(axis=3, dtype=np.float64)
    total = energy.sum(axis=(1, 2))
    x, y = (energy.sum(axis=axis) @ (np.arange(energy.shape[3 - axis]) + 0.5) for axis in (1, 2))
    return np.stack([x, y], axis=1) / total[:, None]


@dataclass(frozen=True)
class _FocalPlane:
    """One focal plane of a lens with axial colour."""

    channels: Map
    """(3,) 1 for its channels of red, green and blue, otherwise 0."""
    nearer: float
    """Pixels of displacement by which the scene is nearer to the lens, relative to it."""

    def displacement(self, one: SmallHighlight) -> float:
        """Return a highlight's displacement from the plane in pixels, at least `LEAST_RADIUS`."""
        found = one.displacement + self.nearer
        return float(np.copysign(max(abs(found), LEAST_RADIUS), found))


def _focal_planes(views: Views) -> tuple[_FocalPlane, ...]:
    """Return the focal planes of the channels of views."""
    if not views.axial_colour:
        return (_FocalPlane(np.ones(3, np.float32), 0.0),)
    apart = np.zeros(3, np.float32)
    apart[RED_AND_BLUE] = 1
    return _FocalPlane(1 - apart, 0.0), _FocalPlane(apart, views.lens.disparity_scale * views.axial_shift)


class _Veil:
    """A CG layer that stays sharp, and hides discs where it stands in the picture."""

    def __init__(self, layer: CGLayer, lens: ThinLens, size: tuple[int, int]) -> None:
        self.left = 1 - layer.on_raster((0, 0), size).picture[..., 3]
        """(h, w) share of light that passes beside it."""
        self.displacement = float(np.median(layer.displacement(lens)))


@dataclass(frozen=True)
class HighlightDiscs:
    """The highlights of a frame and the aperture."""

    found: tuple[SmallHighlight, ...]
    aperture: Aperture

    def light(
        self,
        views: Views,
        layers: Sequence[Layer],
        cg: Sequence[CGLayer] = (),
        steadied: Steadied | None = None,
    ) -> LinearRGB:
        """Draw the discs as linear light (h, w, 3) in the canvas of the views; passes checkpoints.

        Layers of the clip and of CG objects clip them. `steadied` is the views' steadier camera, if any.
        """
        height, width = views.canvas.pinhole.height, views.canvas.pinhole.width
        total: LinearRGB = np.zeros((height, width, 3), np.float32)
        own = views.canvas.pinhole if steadied is None else steadied.own_canvas.pinhole
        lens = views.lens if steadied is None else steadied.own_lens
        before = Surfaces(layers, [each for each in cg if not each.is_sharp], lens, (own.height, own.width))
        sharp = [_Veil(each, lens, (height, width)) for each in cg if each.is_sharp]
        for one, focal_plane in product(self.found, _focal_planes(views)):
            checkpoint()
            focused = replace(one, light=one.light * focal_plane.channels)
            if not focused.light.any():
                continue
            discs, corners = self._discs(focused, views, before, focal_plane, steadied)
            veils = [each.left for each in sharp if each.displacement > one.displacement]
            for disc, (row, column) in zip(discs, corners.tolist(), strict=True):
                top, left = max(0, -row), max(0, -column)
                part = disc[top : max(0, height - row), left : max(0, width - column)]
                if not part.size:
                    continue
                rows, columns = (
                    slice(n, n + m) for n, m in zip((row + top, column + left), part.shape, strict=False)
                )
                for veil in veils:
                    part = part * veil[rows, columns, None]
                total[rows, columns] += part
        if views.is_cut:
            total /= light_left(views)[..., None]
        return total

    def _discs(
        self,
        one: SmallHighlight,
        views: Views,
        before: Surfaces,
        focal_plane: _FocalPlane,
        steadied: Steadied | None,
    ) -> tuple[LinearRGB, Ints]:
        """Light (n, h, w, 3) of a highlight's discs by parts, and first rows and columns (n, 2), any sign."""
        pinhole = views.canvas.pinhole
        seen_here = _as_seen(one, steadied) if steadied else one
        displacement = focal_plane.displacement(seen_here)
        radius = np.round(FINEST * displacement * pinhole.focal / pinhole.fx) / FINEST
        is_bent = views.aberrations.is_active
        if is_bent:
            kernel = _bent_kernel(self.aperture, views, radius, seen_here.place)
        else:
            kernel = _kernel(self.aperture, float(radius[0]), float(radius[1]))
        reach = [n // 2 for n in kernel.shape]
        steps = before.steps(one.place, max(one.light.shape[:2]), one.displacement)
        # An occluder covers another part of the disc for each point of a highlight.
        light, corner = seen_here.parts(PARTS if len(steps) else 1)
        begin = corner - np.array(reach, np.int32)
        places = _middles(light) + corner[:, ::-1]
        if views.is_cut and not is_bent:
            kernels = (kernel * _within_barrel(views, place, radius, reach) for place in places)
            parts = zip(np.split(light, len(light)), kernels, strict=True)
            discs = np.concatenate([_filtered(part, cut, reach) for part, cut in parts])
        else:
            # Parts are channels to OpenCV, which limits their number.
            some = CHANNELS // 3
            discs = np.concatenate(
                [_filtered(light[at : at + some], kernel, reach) for at in range(0, len(light), some)]
            )
        if not len(steps):
            return discs, begin
        number, row, column = np.nonzero(brightest(discs) > 0)
        # A view at the share p of the aperture sees it at place - displacement p.
        seen: Floats = np.stack([column, row], axis=1) + begin[number, ::-1] + np.float64(0.5)
        ways: Floats = (places[number] - seen) / radius
        if is_bent:
            matrix = views.reach * views.aberrations.matrix(views.field_places(seen_here.place))
            ways = (places[number] - seen) @ np.linalg.inv(_invertible(np.diag(radius) - matrix)).T
        if steadied:
            ways = steadied.middle + steadied.aperture_share * ways
            # The frame's own layers occlude it at its position in the frame.
            places = one.place + (places - seen_here.place) / steadied.enlargement
        widths = np.full(len(ways), float(light.shape[1]))
        passed = before.transmittance(one.displacement, steps, places[number], widths, ways)
        discs[number, row, column] *= passed.astype(np.float32)[:, None]
        return discs, begin


def _as_seen(one: SmallHighlight, steadied: Steadied) -> SmallHighlight:
    """Move a highlight to the canvas of a steadier camera, enlarged as the picture is."""
    own, zoom = steadied.own_lens, steadied.enlargement
    inverse = np.array([own.focus + one.displacement / own.disparity_scale])
    place, there = steadied.moved(one.place[None], inverse)
    displacement = float(steadied.lens.displacement(there)[0])
    size = np.ceil(zoom * np.array(one.light.shape[1::-1])).astype(int) + 2
    middle = one.place - one.corner[::-1]
    corner = np.floor(place[0] - zoom * middle).astype(int) - 1
    # From the new patch's pixels to the old one's, both counted from the centre of the first.
    shift = middle + (corner + 0.5 - place[0]) / zoom - 0.5
    back = np.column_stack([np.eye(2) / zoom, shift])
    light = cv2.warpAffine(
        one.light, back, (int(size[0]), int(size[1])), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    )
    # Resampling keeps the sum of the light, not its brightness.
    light = light * np.float32(zoom**2 * one.light.sum() / max(float(light.sum()), 1e-30))
    return SmallHighlight((int(corner[1]), int(corner[0])), np.asarray(light, np.float32), displacement)


def _filtered(light: LinearRGB, kernel: Map, reach: list[int]) -> LinearRGB:
    """Spread patches of light (n, s, s, 3) by a kernel with a reach in pixels, as (n, h, w, 3)."""
    count, size = light.shape[:2]
    wide = np.zeros((size + 2 * reach[0], size + 2 * reach[1], 3 * count), np.float32)
    wide[reach[0] :, reach[1] :][:size, :size] = np.moveaxis(light, 0, 2).reshape(size, size, -1)
    # OpenCV correlates, so the kernel is flipped.
    found = cv2.filter2D(wide, -1, kernel[::-1, ::-1], borderType=cv2.BORDER_CONSTANT)
    return np.ascontiguousarray(np.moveaxis(np.maximum(found, 0).reshape(*wide.shape[:2], count, 3), 2, 0))


@lru_cache(maxsize=256)
def _kernel(aperture: Aperture, across: float, down: float) -> Map:
    """(h, w) shares of a disc's light, of sum 1, sides odd; radii (px) are negative behind the focus."""
    reach = [int(np.ceil(abs(radius))) + 1 for radius in (down, across)]
    y, x = ((np.arange(SUBSAMPLES * (2 * n + 1)) + 0.5) / SUBSAMPLES - n - 0.5 for n in reach)
    fine = aperture.light(*np.meshgrid(-x / across, -y / down))
    cells = fine.reshape(2 * reach[0] + 1, SUBSAMPLES, 2 * reach[1] + 1, SUBSAMPLES).mean(axis=(1, 3))
    return np.asarray(cells / cells.sum(), np.float32)


def _bent_kernel(aperture: Aperture, views: Views, radius: Floats, place: Floats) -> Map:
    """Return `_kernel` of the aberrations of views at a position (2,), within its barrel and matte box."""
    largest = float(np.abs(radius).max()) + views.reach * views.aberrations.largest
    size = 2 * (int(np.ceil(largest)) + 1) + 1
    across = (np.arange(BENT * size) + 0.5) * 2 / (BENT * size) - 1
    x, y = np.meshgrid(across, across)
    light = aperture.light(x, y)
    is_open = light > 0
    p, light = np.column_stack([x[is_open], y[is_open]]), light[is_open]
    bent = views.reach * views.aberrations.shift(p, views.field_places(place)) - p * radius
    passed = light * _passed(views, p, place + bent, 0.5 / largest)
    return np.asarray(scattered(bent, passed, size) / light.sum(), np.float32)


def _invertible(matrix: Floats) -> Floats:
    """Return a matrix (2, 2) with singular values of at least `LEAST_RADIUS`."""
    left, values, right = np.linalg.svd(matrix)
    return np.asarray(left * np.maximum(values, LEAST_RADIUS) @ right)


def _within_barrel(views: Views, place: Floats, radius: Floats, reach: list[int]) -> Map:
    """Return the (h, w) transmission of barrel and matte box around a disc at a position (2,)."""
    beside = np.stack(np.meshgrid(*(np.arange(-n, n + 1) for n in reach[::-1])), axis=-1)
    # Their edges are a pixel wide.
    edge = 0.5 / float(np.abs(radius).min())
    return _passed(views, -beside / radius, place + beside, edge).astype(np.float32)


def _passed(views: Views, p: Floats, xy: Floats, edge: float) -> Floats:
    """Return the transmission (...) of barrel and matte box from places p (..., 2) to pixels xy (..., 2)."""
    away = xy - views.canvas.pinhole.principal_point
    passed: Floats = np.ones(p.shape[:-1])
    if views.vignetting:
        at = p + barrel_shift(views) * away
        passed = barrel_share(at[..., 0], at[..., 1], edge)
    if any(views.matte_box):
        at = p + matte_box_shift(views) * away
        passed = passed * matte_box_share(at[..., 0], at[..., 1], edge)
    return passed


@dataclass(frozen=True)
class TrackedDepth:
    """Feature points of a frame with triangulated depth."""

    places: Floats
    """(n, 2) x and y in pixels of the canvas."""
    displacement: Map
    """(n,) pixels at the aperture's rim, relative to the focal plane."""


def without_small_highlights(
    picture: LinearRGBA, displacement: Map, aperture: Aperture, tracked: TrackedDepth | None = None
) -> tuple[LinearRGBA, HighlightDiscs | None]:
    """Remove the light of small highlights, those with discs of `WIDER`, from a linear picture (H, W, 4).

    `displacement` (H, W) is in pixels at the aperture's rim, relative to the focal plane; by stereo, it is
    corrected by `tracked` feature points.

    Returns:
        The picture without that light, and the highlights; the same picture and None without any.
    """
    peak = brightest(picture)
    over = peak > WHITE
    if not (peak > BRIGHT).any():
        return picture, None
    count, label, stats, _ = cv2.connectedComponentsWithStats(over.astype(np.uint8), connectivity=8)
    of, values = label[over], peak[over]
    most, energy = np.zeros(count, np.float32), np.bincount(of, values, count)
    np.maximum.at(most, of, values)
    size = stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1)
    candidates = np.flatnonzero(most > BRIGHT)
    shift = np.zeros(count)
    for number in candidates:
        part = _around(stats[number], 0)
        own = label[part] == number
        shift[number] = _median(displacement[part][own], peak[part][own])
    if tracked is not None:
        own = _nearest_of(label, np.isin(label, candidates), displacement, shift)
        shift = _tracked(tracked, own, shift)
    candidates = candidates[2 * np.abs(shift[candidates]) >= WIDER * size[candidates]]
    candidates = candidates[np.argsort(-energy[candidates])][:MOST]
    if not len(candidates):
        return picture, None
    own = _nearest_of(label, np.isin(label, candidates), displacement, shift)
    colour = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGBA2RGB), np.float32)
    light, rest, lit = np.zeros_like(colour), picture.copy(), own > 0
    light[lit] = np.maximum(colour[lit] - inpainted(colour, ~lit)[lit], 0)
    rest[lit, :3] -= light[lit]
    found = []
    for number in candidates:
        part = _around(stats[number], RIM)
        found.append(SmallHighlight(
            (part[0].start, part[1].start), light[part] * (own[part] == number)[..., None],
            float(shift[number]),
        ))  # fmt: skip
    return rest, HighlightDiscs(tuple(one for one in found if one.light.any()), aperture)


def _tracked(tracked: TrackedDepth, own: Ints, shift: Floats) -> Floats:
    """Return (c,) displacements of labels: the median of their feature points, if it is nearer than `shift`.

    Stereo compares windows, which show more background than a lamp of a few pixels; a lamp farther than its
    surface would be occluded by it.
    """
    height, width = own.shape
    column, row = np.clip(np.floor(tracked.places).astype(int), 0, [width - 1, height - 1]).T
    of, found = own[row, column], shift.copy()
    for number in np.unique(of[of > 0]):
        found[number] = max(shift[number], float(np.median(tracked.displacement[of == number])))
    return found


def _median(values: Map, weights: Map) -> float:
    """Return the weighted median of values (n,), as a lamp clips background pixels, too."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def _around(stats: Ints, reach: int) -> tuple[slice, slice]:
    """Return rows and columns of an OpenCV component and `reach` pixels around."""
    x, y, width, height = (int(n) for n in stats[:4])
    return slice(max(0, y - reach), y + height + reach), slice(max(0, x - reach), x + width + reach)


def _nearest_of(label: Ints, highlights: Mask, displacement: Map, shift: Floats) -> Ints:
    """(H, W) labels of highlights, grown by `RIM` pixels at the same displacement (H, W); 0 elsewhere."""
    own, distance = of_nearest(label, highlights)
    own = np.where(distance <= RIM, own, 0)
    beside = np.abs(displacement - shift[own]) > np.maximum(NEARER, np.abs(shift[own]) / 8)
    return np.where(highlights | ((label == 0) & ~beside), own, 0)
