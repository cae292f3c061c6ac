"""A mesh whose triangle sides follow the edges in the picture, so that few triangles span two things.

The thesis's outlook, section 5.2: a method "which takes as input not only the points to be triangulated, but
also information about intensity edges". A straight edge is a row of vertices, close enough together that all
its pieces are sides of Delaunay triangles (a conforming triangulation). Its depth is that of the features
beside it that no other edge hides. Where both sides differ there is a row on either side, and the triangles
between them stretch. Edges far from all jumps are paint, and left out: their vertices would be less certain
than the features around.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..base.arrays import Floats, Ints, LinearRGBA, Mask
from ..camera.canvas import Canvas
from ..depth.sparse import DepthSamples
from ..media.clip import encode_srgb
from .mesh import WarpMesh, delaunay, distinct, nearest_mean, ring

SHORTEST = 8.0
"""Pixels of an edge that counts. Chosen by inspection."""
TRIM = 1.5
"""Pixels less at either end, so that the rows of edges that meet at a corner do not cross. Chosen by
inspection."""
PIECE = 8.0
"""Pixels between two vertices of an edge at most. Chosen by inspection."""
GAP = 0.75
"""Pixels from an edge to the row of vertices on either side of it. Chosen by inspection."""
DISCONTINUITY = 3.0
"""Pixels of disparity at the aperture's rim by which both sides of an edge move apart. Chosen by
inspection."""
CLEARANCE = 2.5
"""Pixels beside an edge within which a feature is on both sides; where depth jumps, none. Chosen by
inspection."""
OTHER_SIDE = 10.0
"""Pixels that a feature within the clearance is farther from the other side than from its own. Chosen by
inspection."""
ALONG = 0.4
"""Weight of a feature's distance along an edge, against that across it. Chosen by inspection."""
FEATURES = 3
"""Features on one side of a vertex, whose median depth it gets. Chosen by inspection."""
CANDIDATES = 10
"""Nearest features; those not hidden by another edge give a vertex's depth. Chosen by inspection."""
REACH = 60.0
"""Pixels, those along the edge weighted, beyond which a feature is not used. Chosen by inspection."""
SPLITS = 6
"""Rounds of splitting pieces of edges that are no sides yet: from 8 pixels to less than one."""
CHUNK = 2_000_000
"""Pairs of places and features that are looked at at once, so that tables take tens of megabytes."""


@dataclass(frozen=True)
class Rows:
    """Straight rows of vertices in pieces, which become sides of triangles."""

    xy: Floats
    """(v, 2) in pixels."""
    inverse_depth: Floats
    """(v,)"""
    pieces: Ints
    """(p, 2) vertices at both ends of a piece."""
    edges: Floats
    """(m, 2, 2) both ends of the edges at which depth jumps."""


def edge_mesh(
    features: DepthSamples,
    canvas: Canvas,
    margin: float,
    picture: LinearRGBA,
    scale: float,
) -> WarpMesh:
    """The mesh of features and edges, extrapolated past the border by `margin` pixels.

    `picture` (h, w, 4) is the canvas picture, linear; inverse depth times `scale` is disparity in pixels at
    the aperture's rim. UserError where the frame has too few features.
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
    """(m, 2, 2) both ends of the straight edges in a linear picture (h, w, 3 or 4), in pixels.

    Grompone von Gioi et al., "LSD: a fast line segment detector with a false detection control", 2010.
    """
    shown = np.rint(255 * encode_srgb(np.clip(picture[..., :3], 0, 1))).astype(np.uint8)
    found = cv2.createLineSegmentDetector().detect(cv2.cvtColor(shown, cv2.COLOR_RGB2GRAY))[0]
    if found is None:
        return np.zeros((0, 2, 2))
    # OpenCV counts from the centre of the first pixel.
    ends = np.asarray(found, np.float64).reshape(-1, 2, 2) + 0.5
    return ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) >= SHORTEST]


def edge_rows(
    edges: Floats,
    xy: Floats,
    inverse: Floats,
    size: tuple[int, int],
    scale: float,
) -> Rows:
    """Rows of vertices along those edges (m, 2, 2) near which depth varies: two where it jumps, else one.

    Depth is that of features at (n, 2) with inverse depths (n,), beside an edge on either side, or the mean
    of both; `size` is the picture's, width and height; inverse depth times `scale` is disparity in pixels.
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
    """Delaunay triangles (t, 3) of places (n, 2) that have pieces (p, 2), pairs of places, as sides.

    A piece that is none is split in the middle, `SPLITS` times, but not below a pixel. Returned are places
    and inverse depths with the middles, triangles, and pieces as they are then.
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
    """(p,) whether pairs of vertices (p, 2) are sides of triangles (t, 3)."""
    count = int(triangles.max()) + 1
    sides, wanted = (
        np.sort(pairs.astype(np.int64), axis=1) @ [count, 1]
        for pairs in (triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), pieces)
    )
    return np.isin(wanted, sides)


def _sampled(edges: Floats, step: float) -> tuple[Ints, Floats]:
    """Edges (v,), and places (v, 2) on them from end to end, `step` pixels apart at most."""
    count = np.ceil(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) / step).astype(int) + 1
    edge = np.repeat(np.arange(len(edges), dtype=np.int32), count)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    share = (number / (count - 1)[edge])[:, None]
    return edge, (1 - share) * edges[edge, 0] + share * edges[edge, 1]


def _trimmed(edges: Floats, trim: float) -> Floats:
    """Edges (m, 2, 2) so many pixels shorter at either end."""
    way = edges[:, 1] - edges[:, 0]
    less = trim * way / np.linalg.norm(way, axis=1)[:, None]
    return edges + np.stack([less, -less], axis=1)


def _row(kind: Mask, edge: Ints, place: Floats, inverse: Floats) -> tuple[Floats, Floats, Ints]:
    """The vertices (v,) of one kind, and the pairs of them that follow each other on one edge."""
    chosen = np.nonzero(kind)[0]
    follows = np.nonzero((np.diff(chosen) == 1) & (np.diff(edge[chosen]) == 0))[0]
    return place[chosen], inverse[chosen], np.column_stack([follows, follows + 1]).astype(np.int32)


def _chunks(rows: int, columns: int, chunk: int) -> list[slice]:
    """Rows of a large table in parts that do not fill the memory."""
    step = max(chunk // max(columns, 1), 1)
    return [slice(first, first + step) for first in range(0, rows, step)]


def _nearest(places: Floats, xy: Floats, count: int) -> Ints:
    """(v, count) which of (n, 2) are nearest to places (v, 2)."""
    squared = ((places[:, None] - xy) ** 2).sum(axis=2)
    return np.argpartition(squared, min(count, len(xy)) - 1, axis=1)[:, :count].astype(np.int32)


def _side_depth(
    place: Floats,
    along: Floats,
    across: Floats,
    walls: Ints,
    edge: Ints,
    xy: Floats,
    inverse: Floats,
) -> Floats:
    """(v,) inverse depth beside places (v, 2) of edges (v,), on the side of `across` (v, 2); NaN if unknown.

    The median of the nearest features on this side that the pixels of other edges in `walls` do not hide.
    """
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
    """(h, w) the edge that runs through a pixel, two pixels wide so that nothing slips through; else -1."""
    walls = np.full((size[1], size[0]), -1, np.int32)
    edge, place = _sampled(edges, 0.5)
    for shift in np.ndindex(2, 2):
        column, row = np.clip(np.floor(place - 0.5).astype(int) + shift, 0, np.array(size) - 1).T
        walls[row, column] = edge
    return walls


def _hidden(eye: Floats, seen: Floats, walls: Ints, own: Ints, clearance: float) -> Mask:
    """(r,) whether another edge than `own` (r,) lies between places (r, 2) and others (r, 2)."""
    way = seen - eye
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
    result = np.zeros(len(eye), bool)
    live, step = np.arange(len(eye)), 2
    # A step a pixel; a feature close to an edge may be a corner of it, and counts as seen.
    while len(live := live[step < length[live] - 2 * clearance]):
        at = np.floor(eye[live] + (step / length[live])[:, None] * way[live]).astype(int)
        column, row = np.clip(at, 0, np.array(walls.shape[::-1]) - 1).T
        hit = (walls[row, column] >= 0) & (walls[row, column] != own[live])
        result[live[hit]] = True
        live, step = live[~hit], step + 1
    return result


def _medians(group: Ints, values: Floats, count: int) -> Floats:
    """(count,) lower median of the values (v,) of each group, 0 where there are none."""
    order = np.lexsort((values, group))
    number = np.bincount(group, minlength=count)
    first = np.cumsum(number) - number
    found = np.zeros(count)
    found[number > 0] = values[order][(first + (number - 1) // 2)[number > 0]]
    return found


def _joined(xy: Floats, inverse: Floats, pieces: Ints, edges: Floats, size: tuple[int, int]) -> Rows:
    """Rows with vertices in the picture, one a pixel at most: the nearest in depth where edges meet."""
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
    """(n,) places (n, 2) farther than the clearance from all of edges (m, 2, 2)."""
    start, way = edges[:, 0], edges[:, 1] - edges[:, 0]
    result = np.ones(len(xy), bool)
    for some in _chunks(len(xy), len(edges), CHUNK):
        off = xy[some, None] - start
        share = np.clip((off * way).sum(axis=2) / (way**2).sum(axis=1), 0, 1)
        distance = np.linalg.norm(off - share[..., None] * way, axis=2)
        result[some] = distance.min(axis=1, initial=np.inf) > CLEARANCE
    return result
