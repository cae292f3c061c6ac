"""Layers of a frame with dense depth: their meshes and pictures."""

from collections.abc import Callable, Sequence
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Ints, LinearRGB, LinearRGBA, Map, Mask
from ..base.progress import checkpoint
from ..base.side_by_side import side_by_side
from ..depth.source import PixelDepth, extended
from ..optics.thin_lens import ThinLens
from .disocclusion_fill import HiddenColours
from .layer import BORROWED, INPAINTED, OWN, Layer
from .layered_depth_image import EXTRAPOLATION, Fill, LayeredDepthImage, depth_peel
from .mesh import WarpMesh
from .quadtree import COARSEST, DISOCCLUDED_ERROR, Surfaces, Triangles, triangulate

FINER = 2
"""Texels a pixel along each axis: a view interpolates with less loss."""
_AWAY = np.arange(-3, 5) - 0.5
_LANCZOS = np.sinc(_AWAY) * np.sinc(_AWAY / 4)
HALFWAY = (_LANCZOS / _LANCZOS.sum()).astype(np.float32)
"""(8,) Lanczos weights, of sum 1, of the eight pixels around the middle between two."""
TILE = 1 << COARSEST
"""Side in pixels of the tiles of a front that are refined: the coarsest cell of the mesh."""
SPARE = 16
"""Refined pixels around the drawn part of a front, for blur: a 96-pixel disc in 16 views blurs by 12."""
ERROR = 0.33
"""Largest error in pixels of the mesh in a view. Chosen by inspection, with bars and foreground of `python -m
benchmarks.accuracy`: a third of a pixel of noise is no silhouette."""
RELATIVE_ERROR = 0.03
"""Additional error as a share of the blur's radius. Chosen by inspection."""
JUMP = 0.19
"""Displacement at which neighbours are cut, as a share of the largest blur's radius. Chosen by inspection."""
JUMP_BOUNDS = (1.0, 3.0)
"""Bounds of this jump in pixels. Chosen by inspection."""
FIRST_JUMP = 0.5
"""First jump, as a share of the largest blur's radius without outliers, so that three surfaces can meet. By
`python -m benchmarks.accuracy`: fence has 35.1 instead of 33.8 dB (32 px, true depth), walk 42.1 instead of
41.6, with 3.6 instead of 13.0 % of the grid's triangles."""
LARGEST_TEXTURE = 8_000_000
"""Most texels; a larger texture, from about 1280x720 on, has the frame's resolution. Once prefiltered, that
costs 0.04 to 0.16 dB at 640x360 (bars, walk, fence, blocks, 32 px, 16 views) and leaves a phone's frames
equal to 60 dB; at 1920x1080 it saves a fifth of a frame's time and a third of its memory (scratch scripts;
`python -m benchmarks.timings.frame_costs`)."""
BURIED = EXTRAPOLATION // 2
"""Pixels from visible surfaces beyond which nothing behind shows."""
WIDEST = 0.25
"""Limit of the displacement from the focal plane, as a share of the long side. Chosen by inspection."""


def layer_mesh(
    picture: LinearRGBA,
    depth: PixelDepth,
    thin_lens: ThinLens,
    hidden: HiddenColours | None = None,
    largest_texture: int = LARGEST_TEXTURE,
    beyond: float = 0.0,
) -> tuple[Layer, ...]:
    """Make the layers of a picture through a thin lens, near to far (Shade et al., 1998).

    Args:
        picture: (H, W, 4) of the canvas, linear and premultiplied.
        depth: Depth of its pixels and past its border, not `ThinLens.rectified`.
        thin_lens: Gives the displacement of pixels in views; the meshes' inverse depths are its `rectified`.
        hidden: Colours of other frames behind silhouettes and past the border; by default they are inpainted.
        largest_texture: Most texels of all layers together, if they are finer than the picture.
        beyond: Pixels past the border besides those that the lens's views see, for cameras with another
            direction.
    """
    splits, wide, past_border = cut(picture, depth, thin_lens, hidden, beyond)
    found = triangulated(splits, thin_lens.snap_displacement)
    covered = []
    for split, (_, triangles) in zip(splits, found, strict=True):
        # The near surface is transparent past its silhouettes.
        split.front[split.is_far & triangles.before] = 0
        covered.append(triangles.before.copy())
        covered[-1].ravel()[triangles.cut.ravel()] = True
    checkpoint(0.8)
    pictures, fronts = [wide, *(split.back for split in splits)], [split.front for split in splits]
    finer = FINER if len(pictures) * covered[0].size * FINER**2 <= largest_texture else 1
    margin = (wide.shape[0] - picture.shape[0]) // 2
    mesh = partial(_mesh, margin, finer, thin_lens)
    surfaces, last = [[(made.near, rows.near), (made.own, rows.cut)] for made, rows in found], found[-1]
    meshes = [mesh([(last[0].far, last[1].far)]), *map(mesh, surfaces)]
    painted = _refined(pictures, fronts, covered) if finer > 1 else [*fronts, pictures[-1]]
    origins = _origins(splits, margin, past_border)
    layers = [
        Layer(
            mesh, texels, False, np.where(split.is_far & shown, split.near_disparity, split.front_disparity),
            _alpha(split, shown), shown, _buried(split), origin, split.jump,
        )
        for split, mesh, texels, shown, origin in zip(
            splits, meshes[1:], painted, covered, origins, strict=False
        )
    ]  # fmt: skip
    whole, far = np.ones_like(covered[0]), splits[-1]
    layers.append(Layer(
        meshes[0], painted[-1], True, far.back_disparity, whole.astype(np.float32), whole, ~whole,
        origins[-1], far.jump,
    ))  # fmt: skip
    return tuple(layers)


def cut(
    picture: LinearRGBA,
    depth: PixelDepth,
    thin_lens: ThinLens,
    hidden: HiddenColours | None = None,
    beyond: float = 0.0,
) -> tuple[tuple[LayeredDepthImage, ...], LinearRGBA, Mask | None]:
    """Cut a picture and its surroundings at depth jumps; arguments as of `layer_mesh`.

    Returns:
        The splits, near to far; the picture with its surroundings (h, w, 4), which has it in its middle; and
        the pixels (h, w) past the border with colours of other frames, None without any.
    """
    reach, focus = WIDEST * max(picture.shape[:2]), thin_lens.disparity_scale * thin_lens.focus
    fill = None if hidden is None else _fill_of(hidden, picture, thin_lens)

    def relative(inverse_depth: Floats | Map) -> Map:
        # Relative to the focal plane, disparities are exact in its vicinity.
        disparity = thin_lens.disparity(thin_lens.rectified_raster(inverse_depth))
        return np.clip(disparity - focus, -reach, reach).astype(np.float32)

    shift = relative(depth.inverse_depth)
    past = None if fill is None or depth.past_border is None else relative(depth.past_border)
    seen = int(np.ceil(thin_lens.stretch * np.abs(shift).max()))
    margin = max(seen, _visible_margin(past, shift.shape)) + int(np.ceil(beyond)) + 2
    checkpoint()
    wide = np.pad(picture, ((margin, margin), (margin, margin), (0, 0)), mode="symmetric")
    shift = np.pad(shift, margin, mode="edge")
    past_border = None
    if fill is not None:
        checkpoint(0.05)
        past_border = _fill_margin(wide, shift, margin, past, fill)
    checkpoint(0.1)
    # The extension past the border does not influence the jumps.
    own = np.abs(shift[margin:-margin, margin:-margin])
    jump = float(np.clip(JUMP * float(own.max()), *JUMP_BOUNDS))
    # Outliers of depth must not influence the first jump.
    first = FIRST_JUMP * float(np.percentile(own[::4, ::4], 99.9))
    jumps = (first, jump) if first > jump else (jump,)
    checkpoint(0.1)
    opacity, behind = (
        None if each is None else np.pad(each, margin, constant_values=np.nan)
        for each in (depth.opacity, None if depth.behind is None else relative(depth.behind))
    )
    return depth_peel(wide, shift, jumps, fill, opacity, behind), wide, past_border


def _alpha(split: LayeredDepthImage, covered: Mask) -> Map:
    """Return the opacity (H, W) of a near surface by its pixels."""
    # At the free end of a near surface, the surface beside it is another one.
    past = split.is_far & covered
    beside = cv2.dilate(past.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(beside & ~covered, 0, split.front[..., 3])


def _buried(split: LayeredDepthImage) -> Mask:
    """Mark (H, W) pixels far behind a near surface, which no view sees."""
    around = np.ones((2 * BURIED + 1, 2 * BURIED + 1), np.uint8)
    return np.asarray(split.occluded & (cv2.dilate(split.disoccluded.astype(np.uint8), around) == 0))


def _origins(
    splits: Sequence[LayeredDepthImage], margin: int, past_border: Mask | None
) -> list[NDArray[np.uint8]]:
    """Return the sources (H, W) of light of every surface, near to far."""
    found = np.full(splits[0].mixed.shape, INPAINTED, np.uint8)
    found[margin:-margin, margin:-margin] = OWN
    if past_border is not None:
        found[past_border] = BORROWED
    origins = [found]
    for split in splits:
        beyond = np.where(split.reprojected, np.uint8(BORROWED), np.uint8(INPAINTED))
        origins.append(np.where(split.occluded, beyond, origins[-1]))
    return origins


def _fill_of(hidden: HiddenColours, picture: LinearRGBA, thin_lens: ThinLens) -> Fill:
    """Adapt hidden colours to disparities on a raster around the picture (H, W, 4)."""

    def fill(disparity: Map, wanted: Mask) -> tuple[LinearRGB, Mask]:
        row, column = np.nonzero(wanted)
        corner = (np.array(disparity.shape) - picture.shape[:2]) // 2
        places = np.column_stack([column - corner[1], row - corner[0]]) + 0.5
        colour, found = np.zeros((*disparity.shape, 3), np.float32), np.zeros(disparity.shape, bool)
        inverse = thin_lens.focus + disparity[row, column] / np.float64(thin_lens.disparity_scale)
        colour[row, column], found[row, column] = hidden(places, thin_lens.unrectified(inverse, places))
        return colour, found

    return fill


def _visible_margin(past: Map | None, shape: tuple[int, ...]) -> int:
    """Return the pixels past the border (h, w) within which views see known disparities `past`, or NaN."""
    if past is None:
        return 0
    away = (
        np.maximum(np.arange((large - n) // 2, (large - n) // 2 - large, -1), 0)
        + np.maximum(np.arange(large) - (large + n) // 2 + 1, 0)
        for large, n in zip(past.shape, shape, strict=True)
    )
    row, column = away
    distance = np.maximum(row[:, None], column)
    return int(distance[np.abs(past) >= distance - 1].max(initial=0))


def _fill_margin(wide: LinearRGBA, shift: Map, margin: int, past: Map | None, fill: Fill) -> Mask:
    """Write other frames' colours and disparities into the margins; returns the known colours (H, W)."""
    border = np.ones(shift.shape, bool)
    border[margin:-margin, margin:-margin] = False
    known = np.zeros(shift.shape, bool)
    if past is not None:
        inside = shift[margin:-margin, margin:-margin]
        outer = extended(np.full_like(inside, np.nan), past, margin)
        colour, known = fill(outer, ~np.isnan(outer))
        wide[known, :3], shift[known] = colour[known], outer[known]
    colour, rest = fill(shift, border & ~known)
    wide[rest, :3] = colour[rest]
    return known | rest


def triangulated(
    layers: tuple[LayeredDepthImage, ...], snap: Callable[[Map], Map]
) -> list[tuple[Surfaces, Triangles]]:
    """Return the surfaces of each layered depth image and their triangles.

    `snap` maps disparities (h, w), in pixels relative to the focal plane, to drawn ones.
    """
    error: Map = np.asarray(ERROR + RELATIVE_ERROR * np.abs(layers[-1].back_disparity))
    jobs = []
    for split in layers:
        checkpoint(0.55)
        made = Surfaces(
            snap(split.front_disparity), snap(split.near_disparity), snap(split.back_disparity),
            split.mixed, split.is_far, split.disoccluded,
        )  # fmt: skip
        # Snapping can double the differences of neighbours.
        jobs.append((made, 2 * split.jump, error))
        # The remaining surface is extrapolated or invisible here.
        error = error.copy()
        error[split.occluded & ~split.disoccluded] = np.inf
        error[split.disoccluded] *= np.float32(DISOCCLUDED_ERROR)
    found = side_by_side(lambda job: triangulate(*job), jobs)
    return [(made, triangles) for (made, *_), triangles in zip(jobs, found, strict=True)]


def _refined(pictures: list[LinearRGBA], fronts: list[LinearRGBA], drawn: list[Mask]) -> Sequence[LinearRGBA]:
    """Refine (h, w, 4) n - 1 fronts, as differences to the next picture, and the last picture."""
    # A front that is interpolated alone rings along silhouettes.
    height, width = (FINER * n for n in pictures[0].shape[:2])
    texture = np.zeros((len(pictures), height, width, 4), np.float32)
    wanted, spans = np.zeros_like(drawn[0]), []
    for mask in [*drawn, np.ones_like(wanted)]:
        around = np.ones((2 * SPARE + 1, 2 * SPARE + 1), np.uint8)
        wanted |= cv2.dilate(mask.astype(np.uint8), around) > 0
        spans.append(_spans(wanted))
    jobs = [
        (picture, part, span)
        for picture, part, each in zip(pictures, texture, spans, strict=True)
        for span in each
    ]
    side_by_side(lambda job: _refine(*job), jobs)
    texture[-1, ..., 3] = 1
    checkpoint(0.9)
    for part, behind, front, each in zip(texture[:-1], texture[1:], fronts, spans[:-1], strict=True):
        _subtract_behind(part, behind, front[..., 3], each)
    return list(texture)


def _spans(mask: Mask) -> list[tuple[slice, slice]]:
    """Cover a mask (H, W) by rectangles of `TILE` rows."""
    height, width = mask.shape
    tiles = np.pad(mask, ((0, -height % TILE), (0, -width % TILE)))
    tiles = tiles.reshape(-(-height // TILE), TILE, -1, TILE).any(axis=(1, 3))
    # Starts and ends of the runs of tiles in a row.
    steps = np.diff(np.pad(tiles, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return [
        (slice(r * TILE, min((r + 1) * TILE, height)), slice(first * TILE, min(last * TILE, width)))
        for (r, first), (_, last) in zip(np.argwhere(steps > 0), np.argwhere(steps < 0), strict=True)
    ]


def _refine(picture: LinearRGBA, texture: LinearRGBA, span: tuple[slice, slice]) -> None:
    """Write a span of a picture (H, W, c) into (2 H, 2 W, c), with Lanczos interpolation, not negative."""
    checkpoint(0.9)
    reach = len(HALFWAY) // 2
    low = [max(0, part.start - reach) for part in span]
    around = picture[low[0] : span[0].stop + reach, low[1] : span[1].stop + reach]
    rows, columns = (slice(part.start - n, part.stop - n) for part, n in zip(span, low, strict=True))
    cells = texture.reshape(picture.shape[0], FINER, picture.shape[1], FINER, -1)[span[0], :, span[1]]
    cells[:, 0, :, 0] = around[rows, columns]
    across = cv2.filter2D(around, -1, HALFWAY[None], anchor=(3, 0), borderType=cv2.BORDER_REPLICATE)
    for whole, place in ((around, 0), (across, 1)):
        down = cv2.filter2D(whole, -1, HALFWAY[:, None], anchor=(0, 3), borderType=cv2.BORDER_REPLICATE)
        np.maximum(down[rows, columns], 0, out=cells[:, 1, :, place])
    np.maximum(across[rows, columns], 0, out=cells[:, 0, :, 1])


def _subtract_behind(
    part: LinearRGBA, behind: LinearRGBA, alpha: Map, spans: list[tuple[slice, slice]]
) -> None:
    """Reduce a refined picture (2 H, 2 W, 4) to its difference from the one behind, in spans."""
    clear = cv2.erode(alpha, np.ones((2, 2), np.uint8), anchor=(0, 0)) < 1
    within = np.zeros_like(clear)
    for span in spans:
        within[span] = True
    row, column = np.nonzero(clear & within)
    height, width = alpha.shape
    below, right = np.minimum(row + 1, height - 1), np.minimum(column + 1, width - 1)
    own, beside, under, diagonal = (alpha[r, c] for r in (row, below) for c in (column, right))
    whole, rest = part.reshape(-1, 4), behind.reshape(-1, 4)
    first = FINER**2 * width * row + FINER * column
    half = np.float32(0.5)
    shares = own, half * (own + beside), half * (own + under), half * half * (own + beside + under + diagonal)
    for share, step in zip(shares, (0, 1, FINER * width, FINER * width + 1), strict=True):
        checkpoint(0.95)
        at = first + step
        found = whole[at] - (1 - share)[:, None] * rest[at]
        found[:, 3] = share
        whole[at] = np.maximum(found, 0, out=found)


def _mesh(margin: int, finer: int, lens: ThinLens, surfaces: list[tuple[Map, Ints]]) -> WarpMesh:
    """Make a mesh of surfaces on one raster; inverse depth is disparity / scale past the focal plane."""
    width = surfaces[0][0].shape[1]
    focus, scale = lens.disparity_scale * lens.focus, lens.disparity_scale
    xy, inverse, triangles, first = [], [], [], 0
    for disparity, rows in surfaces:
        checkpoint(0.8)
        used, renamed = np.unique(rows, return_inverse=True)
        row, column = np.divmod(used, width)
        xy.append(np.column_stack([column, row]) + 0.5)
        inverse.append((focus + disparity.ravel()[used].astype(np.float64)) / scale)
        triangles.append(renamed.reshape(-1, 3) + first)
        first += len(used)
    checkpoint(0.85)
    place, depth, rows = np.concatenate(xy), np.concatenate(inverse), np.concatenate(triangles)
    order = np.argsort(depth[rows].min(axis=1), kind="stable")
    # A pixel's centre is a texel's centre: in the focal plane, views show the frame's own pixels.
    texture = finer * (place - 0.5) + 0.5
    return WarpMesh(place - margin, texture, depth, rows[order].astype(np.int32))
