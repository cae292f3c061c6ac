"""Warp meshes: the frame as textured triangles with inverse depth.

Between cameras with parallel axes, a plane's triangle is warped affinely and its inverse depth is affine in
the picture, so pixels and inverse depths of vertices define all views.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Ints, Map
from ..base.counting import counted
from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..depth.sparse import DepthSamples

MIN_FEATURES = 3
"""Features of a triangle."""
MERGE = 0.5
"""Side in pixels of a cell that keeps one feature: closer ones would make slivers. Chosen by inspection."""
AVERAGED = 6
"""Features whose mean is the depth of a place without one. Chosen by inspection."""
SAMPLES = 2_000_000
"""Samples processed at once, in arrays of tens of megabytes."""
EDGE = 1e-9
"""Tolerance of barycentric coordinates: a few roundings of float64."""


@dataclass(frozen=True)
class WarpMesh:
    """Triangles over the actual camera's canvas picture."""

    xy: Floats
    """(V, 2) canvas pixels of the vertices in the actual camera."""
    texture_xy: Floats
    """(V, 2) texture pixels of the vertices, in the canvas picture or several stacked, as fine or finer."""
    inverse_depth: Floats
    """(V,) 1 / z of the vertices in the actual camera, in 1 / scene units; 0 is at infinity."""
    triangles: Ints
    """(T, 3) rows of the vertices."""
    order: Floats | None = None
    """(V,) inverse depths by which triangles hide each other, if other than `inverse_depth`."""

    @property
    def nearness(self) -> Floats:
        """Return the inverse depths (V,) by which triangles hide each other."""
        return self.inverse_depth if self.order is None else self.order


def feature_mesh(features: DepthSamples, canvas: Canvas, margin: float) -> WarpMesh:
    """Triangulate the features and a ring of vertices `margin` pixels past the border.

    The ring takes its inverse depth from the nearest features. Raises UserError for too few features, or if
    they cannot be triangulated.
    """
    keep = distinct(features, canvas)
    inside, inverse = features.observed[keep], features.inverse_depth[keep]
    outside = ring(canvas, max(margin, 2.0))
    xy = np.concatenate([inside, outside])
    return WarpMesh(
        xy=xy,
        texture_xy=xy,
        inverse_depth=np.concatenate([inverse, nearest_mean(inside, inverse, outside)]),
        triangles=delaunay(xy),
    )


def nearest_mean(places: Floats, values: Floats, wanted: Floats) -> Floats:
    """Return means (k,) of the `AVERAGED` values nearest to wanted places, by inverse squared distance.

    Shepard, "A two-dimensional interpolation function", 1968.

    Args:
        places: (n, 2).
        values: (n,).
        wanted: (k, 2) places.
    """
    squared = ((wanted[:, None, :] - places[None, :, :]) ** 2).sum(axis=2)
    count = min(AVERAGED, len(places))
    nearest = np.argpartition(squared, count - 1, axis=1)[:, :count]
    weight = 1.0 / (np.take_along_axis(squared, nearest, axis=1) + 1.0)
    return np.asarray((weight * values[nearest]).sum(axis=1) / weight.sum(axis=1))


def delaunay(xy: Floats) -> Ints:
    """Triangulate distinct points (n, 2) in pixels by Delaunay (T, 3), covering their convex hull.

    OpenCV's subdivision fails on some point sets and loses triangles at the hull of others. So the area is
    checked, and on failure the points are moved by up to a tenth of a pixel. Raises UserError if that fails.
    """
    hull = cv2.convexHull(xy.astype(np.float32))
    wanted = cv2.contourArea(hull)
    rng = np.random.default_rng(0)
    for attempt in range(8):
        # Sixteenths of a pixel are exact in float32, on which the subdivision's predicates depend.
        moved = np.round((xy + rng.uniform(-0.1, 0.1, xy.shape)) * 16) / 16 if attempt else xy
        triangles = _subdivide(moved.astype(np.float32))
        if triangles is None:
            continue
        a, b, c = (xy[triangles[:, i]] for i in range(3))
        areas = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
        if abs(areas.sum() - wanted) < 1e-3 * wanted:
            return triangles
    raise UserError("the feature points of a frame cannot be triangulated; solve the clip again")


def _subdivide(xy: Map) -> Ints | None:
    """Return OpenCV's Delaunay triangles (T, 3) of points (n, 2), or None if it fails."""
    low, high = np.floor(xy.min(axis=0)), np.ceil(xy.max(axis=0))
    # The subdivision's outer triangle must be far away, or triangles at a long hull edge are lost.
    far = 64 * (high - low).max()
    origin = low - far
    size = (high - low) + 2 * far
    subdivision = cv2.Subdiv2D((int(origin[0]), int(origin[1]), int(size[0]), int(size[1])))
    try:
        subdivision.insert(xy.tolist())
        corners = np.asarray(subdivision.getTriangleList(), dtype=np.float32).reshape(-1, 2)
    except cv2.error:
        return None
    order = np.argsort(_key(xy), kind="stable")
    keys = _key(xy)[order]
    wanted = _key(corners)
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    rows = order[at].reshape(-1, 3)
    real = (keys[at] == wanted).reshape(-1, 3).all(axis=1)
    kept: Ints = rows[real].astype(np.int32)
    return kept


def _key(xy: Map) -> NDArray[np.complex128]:
    """Return (n,) sortable keys of positions (n, 2)."""
    return np.asarray(xy[:, 0].astype(np.float64) + 1j * xy[:, 1].astype(np.float64))


def distinct(features: DepthSamples, canvas: Canvas) -> Ints:
    """Return the rows (k,) of features with a depth inside the canvas, one in each half-pixel cell.

    Raises:
        UserError: Too few are left.
    """
    size = np.array([canvas.pinhole.width, canvas.pinhole.height])
    edge = 0.5
    inside = np.all((features.observed > edge) & (features.observed < size - edge), axis=1)
    inside &= np.isfinite(features.inverse_depth) & (features.inverse_depth > 0)
    rows = np.nonzero(inside)[0]
    _, first = np.unique(np.floor(features.observed[rows] / MERGE), axis=0, return_index=True)
    rows = rows[np.sort(first)]
    if len(rows) < MIN_FEATURES:
        raise UserError(
            f"frame {features.frame} has {counted(len(rows), 'usable feature point')}, {MIN_FEATURES} are"
            " needed; leave the frame out or solve the clip again"
        )
    return rows.astype(np.int32)


def ring(canvas: Canvas, margin: float) -> Floats:
    """Return (r, 2) evenly spaced vertices around the canvas, `margin` pixels outside."""
    width, height = canvas.pinhole.width, canvas.pinhole.height
    steps = max(4, round(12 * width / max(width, height))), max(4, round(12 * height / max(width, height)))
    across = np.linspace(-margin, width + margin, steps[0] + 1)
    down = np.linspace(-margin, height + margin, steps[1] + 1)[1:-1]
    return np.concatenate([
        np.stack([across, np.full_like(across, -margin)], axis=1),
        np.stack([across, np.full_like(across, height + margin)], axis=1),
        np.stack([np.full_like(down, -margin), down], axis=1),
        np.stack([np.full_like(down, width + margin), down], axis=1),
    ])  # fmt: skip


def at_pixels(xy: Floats, values: Floats, triangles: Ints, shape: tuple[int, int]) -> Floats:
    """Interpolate values (V,) of vertices (V, 2) in pixels over triangles (T, 3) at pixel centres, (H, W).

    The result is NaN without a triangle, and the largest value of several.

    `cv2.triangleRasterizeDepth` is 4 to 20 times faster, but has no tolerance and uses float32: meshes whose
    vertices are pixel centres, as layers' are, get holes and show the far surface at 437 of 960x720 pixels.
    Drawn four times, each moved by a thousandth of a pixel, it is complete with errors up to 1e-4, but no
    faster for small triangles (57 ms for 8,064).
    """
    result = np.full(shape[0] * shape[1], -np.inf)
    # From here on, pixel centres are whole numbers.
    corners = xy[triangles] - 0.5
    (a, b, c), at_corners = corners.swapaxes(0, 1), values[triangles]
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    last = np.array([shape[1], shape[0]]) - 1
    low = np.maximum(np.ceil(corners.min(axis=1) - EDGE), 0).astype(int)
    high = np.minimum(np.floor(corners.max(axis=1) + EDGE), last).astype(int)
    span = (high - low).max(axis=1) + 1
    there = (area != 0) & (high >= low).all(axis=1)
    size = 1
    while there.any():
        rows = np.nonzero(there & (span <= size))[0]
        there[rows] = False
        chunk = max(1, SAMPLES // size**2)
        for first in range(0, len(rows), chunk):
            some = rows[first : first + chunk]
            _draw(result, shape[1], corners[some], at_corners[some], area[some], low[some], high[some], size)
        size *= 2
    return np.where(np.isfinite(result), result, np.nan).reshape(shape)


def _draw(
    result: Floats,
    width: int,
    corners: Floats,
    values: Floats,
    area: Floats,
    low: Ints,
    high: Ints,
    size: int,
) -> None:
    """Draw n triangles (n, 3, 2), of at most size x size pixels each, into a raveled picture."""
    step = np.arange(size)
    x, y = low[:, 0, None, None] + step, low[:, 1, None, None] + step[:, None]
    inside = (x <= high[:, 0, None, None]) & (y <= high[:, 1, None, None])
    value = np.zeros(inside.shape)
    for n in range(3):
        (px, py), (qx, qy) = (corners[:, (n + k) % 3].T[:, :, None, None] for k in (1, 2))
        share = ((qx - px) * (y - py) - (qy - py) * (x - px)) / area[:, None, None]
        inside &= share >= -EDGE
        value += share * values[:, n, None, None]
    at = np.broadcast_to(y * width + x, inside.shape)[inside]
    np.maximum.at(result, at, value[inside])
