"""A mesh whose triangles follow the edges in the picture, so that few span two surfaces.

From the thesis's outlook, section 5.2: a method "which takes as input not only the points to be triangulated,
but also information about intensity edges". A straight edge becomes a row of vertices, so dense that all its
pieces are sides of Delaunay triangles (a conforming triangulation). Its depth is that of unoccluded features
beside it. Where both sides differ there is a row on each side, and the gap between them stretches. Edges far
from depth jumps are texture, and are left out: features around know their depth better.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from ....base.arrays import Floats, Ints, LinearRGBA, Mask
from ....camera.canvas import Canvas
from ....depth.sparse import DepthSamples
from ....media.light import encode_srgb
from ....warp.mesh import WarpMesh, delaunay, distinct, nearest_mean, ring

SHORTEST = 8.0
"""Shortest edge in pixels. Chosen by inspection."""
TRIM = 1.5
"""Pixels cut from either end, so that rows do not cross where edges meet. Chosen by inspection."""
PIECE = 8.0
"""Most pixels between vertices of an edge. Chosen by inspection."""
GAP = 0.75
"""Pixels from an edge to the rows on either side. Chosen by inspection."""
DISCONTINUITY = 3.0
"""Disparity in pixels at the aperture's rim at which both sides of an edge separate. Chosen by inspection."""
CLEARANCE = 2.5
"""Pixels beside an edge within which a feature is on both sides; none at a jump. Chosen by inspection."""
OTHER_SIDE = 10.0
"""Pixels added to a feature's distance from the other side within the clearance. Chosen by inspection."""
ALONG = 0.4
"""Weight of a feature's distance along an edge, relative to that across. Chosen by inspection."""
FEATURES = 3
"""Features on one side of a vertex whose median is its depth. Chosen by inspection."""
CANDIDATES = 10
"""Nearest features that are tested for occlusion by other edges. Chosen by inspection."""
REACH = 60.0
"""Largest distance in weighted pixels of a feature that gives a vertex its depth. Chosen by inspection."""
SPLITS = 6
"""Rounds of splitting pieces that are not sides: from 8 pixels to less than one."""
CHUNK = 2_000_000
"""Pairs of positions and features processed at once, in tables of tens of megabytes."""


@dataclass(frozen=True)
class Rows:
    """Straight rows of vertices in pieces that must be sides of triangles."""

    xy: Floats
    """(v, 2) in pixels."""
    inverse_depth: Floats
    """(v,)"""
    pieces: Ints
    """(p, 2) vertices at both ends of a piece."""
    edges: Floats
    """(m, 2, 2) ends of the edges at depth jumps."""


def edge_mesh(
    features: DepthSamples, canvas: Canvas, margin: float, picture: LinearRGBA, scale: float
) -> WarpMesh:
    """Make the mesh of features and edges, extrapolated past the border by `margin` pixels.

    Inverse depth times `scale` is disparity in pixels at the aperture's rim. `picture` (h, w, 4) is linear.
    Raises UserError if the frame has too few features.
    """
    keep = distinct(features, canvas)
    xy, inverse = features.observed[keep], features.inverse_depth[keep]
    size = canvas.pinhole.width, canvas.pinhole.height
    rows = edge_rows(detected(picture), xy, inverse, size, scale)
    free = _far_from(rows.edges, xy)
    xy = np.concatenate([rows.xy, xy[free]])
    inverse = np.concatenate([rows.inverse_depth, inverse[free]])
    outside = ring(canvas, max(margin, 2.0))
    inverse = np.concatenate([inverse, nearest_mean(xy, inverse, outside)])
    xy, inverse, triangles, _ = conforming(np.concatenate([xy, outside]), inverse, rows.pieces, SPLITS)
    return WarpMesh(xy, xy, inverse, triangles)


def detected(picture: LinearRGBA) -> Floats:
    """Find the (m, 2, 2) ends of straight edges in a linear picture (h, w, 3 or 4), in pixels.

    Grompone von Gioi et al., "LSD: a fast line segment detector with a false detection control", 2010.
    """
    shown = np.rint(255 * encode_srgb(np.clip(picture[..., :3], 0, 1))).astype(np.uint8)
    found = cv2.createLineSegmentDetector().detect(cv2.cvtColor(shown, cv2.COLOR_RGB2GRAY))[0]
    if found is None:
        return np.zeros((0, 2, 2))
    # OpenCV counts from the centre of the first pixel.
    ends = np.asarray(found, np.float64).reshape(-1, 2, 2) + 0.5
    return ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) >= SHORTEST]


def edge_rows(edges: Floats, xy: Floats, inverse: Floats, size: tuple[int, int], scale: float) -> Rows:
    """Make rows of vertices along edges (m, 2, 2) near which depth varies, two at depth jumps.

    Features at (n, 2) with inverse depths (n,) give the depth of either side, or the mean of both. `size` is
    (width, height); inverse depth times `scale` is disparity in pixels.
    """
    middle = edges.mean(axis=1)
    varies = [
        np.ptp(inverse[_nearest(middle[some], xy, CANDIDATES)], axis=1)
        for some in _chunks(len(edges), len(xy), CHUNK)
    ]
    wanted = np.nonzero(np.concatenate([*varies, np.zeros(0)]) * scale > DISCONTINUITY)[0]
    walls = _walls(edges, size)
    edge, place = _sampled(_trimmed(edges[wanted], TRIM), PIECE)
    own = wanted[edge].astype(np.int32)
    along = (edges[wanted, 1] - edges[wanted, 0])[edge]
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    chunks = _chunks(len(place), len(xy), CHUNK)
    left, right = (
        np.concatenate([
            *(
                _side_depth(place[c], along[c], sign * across[c], walls, own[c], xy, inverse)
                for c in chunks
            ),
            np.zeros(0),
        ])
        for sign in (-1, 1)
    )  # fmt: skip
    jump = np.nan_to_num(np.abs(left - right) * scale)
    apart = (_medians(edge, jump, len(wanted)) > DISCONTINUITY)[edge]
    known = np.isfinite(left) & np.isfinite(right)
    parts = [
        _row(known & kind, edge, place + shift * across, depth)
        for kind, shift, depth in (
            (~apart, 0.0, (left + right) / 2),
            (apart, -GAP, left),
            (apart, GAP, right),
        )
    ]
    first = np.cumsum([0, *(len(part[0]) for part in parts)])
    pieces = np.concatenate([part[2] + start for part, start in zip(parts, first[:-1], strict=True)])
    parted = edges[wanted[np.unique(edge[known & apart])]]
    return _joined(
        np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts]), pieces, parted, size
    )


def conforming(
    xy: Floats, inverse: Floats, pieces: Ints, splits: int = SPLITS
) -> tuple[Floats, Floats, Ints, Ints]:
    """Triangulate positions so that pieces become sides of triangles.

    Pieces longer than a pixel are split in the middle.

    Args:
        xy: (n, 2) positions in pixels.
        inverse: (n,) inverse depths.
        pieces: (p, 2) indices of both ends.
        splits: Rounds of splitting.

    Returns:
        Positions and inverse depths with the middles, Delaunay triangles (t, 3), and the split pieces.
    """
    triangles = delaunay(xy)
    for _ in range(splits):
        ends = xy[pieces]
        split = ~are_sides(pieces, triangles) & (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > 1)
        if not split.any():
            break
        cut = pieces[split]
        middle = np.arange(len(xy), len(xy) + len(cut))
        xy = np.concatenate([xy, xy[cut].mean(axis=1)])
        inverse = np.concatenate([inverse, inverse[cut].mean(axis=1)])
        halves = [np.column_stack([cut[:, end], middle]) for end in (0, 1)]
        pieces = np.concatenate([pieces[~split], *halves]).astype(np.int32)
        triangles = delaunay(xy)
    return xy, inverse, triangles, pieces


def are_sides(pieces: Ints, triangles: Ints) -> Mask:
    """Return whether pairs of vertices (p, 2) are sides of triangles (t, 3), as (p,)."""
    count = int(triangles.max()) + 1
    sides, wanted = (
        np.sort(pairs.astype(np.int64), axis=1) @ [count, 1]
        for pairs in (triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), pieces)
    )
    return np.isin(wanted, sides)


def _sampled(edges: Floats, step: float) -> tuple[Ints, Floats]:
    """Return edge indices (v,) and positions (v, 2) on edges, at most `step` pixels apart."""
    count = np.ceil(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / step).astype(int) + 1
    edge = np.repeat(np.arange(len(edges), dtype=np.int32), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    share = (number / (count - 1)[edge])[:, None]
    return edge, (1 - share) * edges[edge, 0] + share * edges[edge, 1]


def _trimmed(edges: Floats, trim: float) -> Floats:
    """Shorten edges (m, 2, 2) by `trim` pixels at either end."""
    way = edges[:, 1] - edges[:, 0]
    less = trim * way / np.linalg.norm(way, axis=1)[:, None]
    return edges + np.stack([less, -less], axis=1)


def _row(kind: Mask, edge: Ints, place: Floats, inverse: Floats) -> tuple[Floats, Floats, Ints]:
    """Select vertices (v,) by a mask, and pair those that are neighbours on an edge."""
    chosen = np.nonzero(kind)[0]
    follows = np.nonzero((np.diff(chosen) == 1) & (np.diff(edge[chosen]) == 0))[0]
    return place[chosen], inverse[chosen], np.column_stack([follows, follows + 1]).astype(np.int32)


def _chunks(rows: int, columns: int, chunk: int) -> list[slice]:
    """Split the rows of a large table into parts of about `chunk` entries."""
    step = max(chunk // max(columns, 1), 1)
    return [slice(first, first + step) for first in range(0, rows, step)]


def _nearest(places: Floats, xy: Floats, count: int) -> Ints:
    """Return (v, count) indices of the positions (n, 2) nearest to `places` (v, 2)."""
    squared = ((places[:, None] - xy) ** 2).sum(axis=2)
    return np.argpartition(squared, min(count, len(xy)) - 1, axis=1)[:, :count].astype(np.int32)


def _side_depth(
    place: Floats, along: Floats, across: Floats, walls: Ints, edge: Ints, xy: Floats, inverse: Floats
) -> Floats:
    """Return (v,) median inverse depths of unoccluded features on one side of an edge, or NaN."""
    off = xy - place[:, None]
    over, past = (np.einsum("vnk,vk->vn", off, axis) for axis in (across, along))
    far = np.hypot(over, ALONG * past)
    far[over < 0] += OTHER_SIDE
    far[(over < -CLEARANCE) | (far > REACH)] = np.inf
    count = CANDIDATES
    near = np.argpartition(far, min(count, len(xy)) - 1, axis=1)[:, :count]
    far = np.take_along_axis(far, near, axis=1)
    ray, feature = np.nonzero(np.isfinite(far))
    eye = (place + GAP * across)[ray]
    hidden = _hidden(eye, xy[near[ray, feature]], walls, edge[ray], CLEARANCE)
    far[ray[hidden], feature[hidden]] = np.inf
    order = np.argsort(far, axis=1)[:, :FEATURES]
    known = np.isfinite(np.take_along_axis(far, order, axis=1))
    value = np.take_along_axis(inverse[near], order, axis=1)
    value = np.sort(np.where(known, value, np.inf), axis=1)
    middle = np.maximum(known.sum(axis=1) - 1, 0) // 2
    return np.where(known.any(axis=1), value[np.arange(len(value)), middle], np.nan)


def _walls(edges: Floats, size: tuple[int, int]) -> Ints:
    """Draw edges as an index map (h, w), two pixels wide so that rays cannot pass; -1 elsewhere."""
    walls = np.full((size[1], size[0]), -1, np.int32)
    edge, place = _sampled(edges, 0.5)
    for shift in np.ndindex(2, 2):
        column, row = np.clip(np.floor(place - 0.5).astype(int) + shift, 0, np.array(size) - 1).T
        walls[row, column] = edge
    return walls


def _hidden(eye: Floats, seen: Floats, walls: Ints, own: Ints, clearance: float) -> Mask:
    """Return whether another edge than `own` (r,) hides `seen` (r, 2) from `eye` (r, 2), as (r,)."""
    way = seen - eye
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    result = np.zeros(len(eye), bool)
    live, step = np.arange(len(eye)), 2
    # One step a pixel; a feature close to an edge may be a corner of it, and counts as visible.
    while len(live := live[step < length[live] - 2 * clearance]):
        at = np.floor(eye[live] + (step / length[live])[:, None] * way[live]).astype(int)
        column, row = np.clip(at, 0, np.array(walls.shape[::-1]) - 1).T
        hit = (walls[row, column] >= 0) & (walls[row, column] != own[live])
        result[live[hit]] = True
        live, step = live[~hit], step + 1
    return result


def _medians(group: Ints, values: Floats, count: int) -> Floats:
    """Return (count,) lower medians of values (v,) by group, 0 without any."""
    order = np.lexsort((values, group))
    number = np.bincount(group, minlength=count)
    first = np.cumsum(number) - number
    found = np.zeros(count)
    found[number > 0] = values[order][(first + (number - 1) // 2)[number > 0]]
    return found


def _joined(xy: Floats, inverse: Floats, pieces: Ints, edges: Floats, size: tuple[int, int]) -> Rows:
    """Join rows within the picture, one vertex a pixel: the nearest in depth if edges meet."""
    inside = np.all((xy > 0.5) & (xy < np.array(size) - 0.5), axis=1)
    order = np.argsort(-inverse, kind="stable")
    _, first, same = np.unique(np.floor(xy[order]), axis=0, return_index=True, return_inverse=True)
    kept = order[first]
    vertex = np.empty(len(xy), np.int32)
    vertex[order] = same
    keep = inside[kept]
    pieces = np.sort(vertex[pieces], axis=1)
    pieces = pieces[keep[pieces].all(axis=1) & (pieces[:, 0] != pieces[:, 1])]
    pieces = np.unique((np.cumsum(keep) - 1)[pieces].reshape(-1, 2), axis=0)
    return Rows(xy[kept[keep]], inverse[kept[keep]], pieces.astype(np.int32), edges)


def _far_from(edges: Floats, xy: Floats) -> Mask:
    """Mark (n,) positions (n, 2) farther than the clearance from all edges (m, 2, 2)."""
    start, way = edges[:, 0], edges[:, 1] - edges[:, 0]
    result = np.ones(len(xy), bool)
    for some in _chunks(len(xy), len(edges), CHUNK):
        off = xy[some, None] - start
        share = np.clip((off * way).sum(axis=2) / (way**2).sum(axis=1), 0, 1)
        distance = np.linalg.norm(off - share[..., None] * way, axis=2)
        result[some] = distance.min(axis=1, initial=np.inf) > CLEARANCE
    return result
