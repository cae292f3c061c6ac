"""How far a solved clip is from the truth: the figures of the table of motions.

Poses are world-to-camera, points are in the world, pixels as in `addon.core.camera.reconstruction`. A
reconstruction has a world and a unit of its own: every figure is taken after the best rotation, scale or
shift.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Reconstruction
from sample_scenes.stage import Cameras

from ..accuracy.metrics import edge_band

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRID = (8, 6)
"""Cells across and down, which points are to reach."""
CLEAR = 2
"""Pixels from a depth jump within which the depth of an observation is not known."""
JUMP = 0.02
"""Share of the inverse depth that makes a jump here: a tracked point sits on one side of it or the other."""
LEAST_POINTS = 8
PAIRS = 40_000
"""Random pairs of points whose lengths are looked at."""
PURE = 0.1
"""Share of them that runs most nearly along the view, and of those most nearly across.

The longer half of each is compared: short ones measure the noise of two points."""
APART = 0.1
"""Of the median pair's length: what is nearer to each other has no direction."""


@dataclass(frozen=True)
class Truth:
    """What is true of a clip; its frames count from 1."""

    cameras: Cameras
    focals: Floats
    """(N,) focal length in pixels of each frame."""
    depth: Mapping[int, Floats]
    """(H, W) true depth of some frames, inf where there is only air."""
    moves: Mapping[int, Mask]
    """(H, W) bool for the same frames: what is seen there moves by itself."""

    def project(self, points: Floats, frame: NDArray[np.integer]) -> Floats:
        """Each world point (m, 3) in its own frame (m,) -> pixels (m, 2)."""
        cameras, index = self.cameras, frame - 1
        seen = np.einsum("mij,mj->mi", cameras.rotation[index], points) + cameras.translation[index]
        middle = np.array([cameras.width, cameras.height]) / 2
        return np.asarray(self.focals[index, None] * seen[:, :2] / seen[:, 2:] + middle)


@dataclass(frozen=True)
class Figures:
    """What was measured of a solve. Shares are of 1, errors in per cent where no unit is said."""

    registered: float
    """Share of the clip's frames with a pose."""
    points_median: float
    """Points in a frame; a frame without a pose has none."""
    points_least: float
    grid: float
    """Share of the grid's cells that hold a point, mean over the frames."""
    rotation_median: float
    """Degrees."""
    rotation_max: float
    position_path: float
    """RMS error of the camera centres over the extent of the true path."""
    position_depth: float
    """The same over the median depth."""
    focal: float
    """Of the frame that is farthest off, with its sign."""
    lengths: float
    """Median |log| of how far ratios of a length along the view to one across it are off."""
    lengths_floor: float
    """The same of the same observations with the true cameras: what the tracks alone cost."""
    stretch: float
    """The median with its sign: by how much lengths along the view are too long on the whole."""
    inverse_depth: float
    """Median relative error of inverse depth after the best scale, which is what blur depends on."""
    inverse_depth_90: float
    """The 90th percentile."""
    disc: float
    """Median error of inverse depth over its range in the clip (5th to 95th percentile)."""
    track_px: float
    """Median distance of an observation from where the true point is seen, in pixels: the tracker's drift."""
    on_moving_object: float
    """Share of the observations that are of things that move by themselves."""
    measured: int
    """Points whose true place is known."""


class Seen(NamedTuple):
    """Observations flattened over a reconstruction's images."""

    frame: NDArray[np.int64]
    """(m,) clip's frame number."""
    xy: Floats
    """(m, 2)"""
    point: NDArray[np.int64]
    """(m,) row of the reconstruction's points."""
    z: Floats
    """(m,) depth of the point in that frame, in the reconstruction's unit."""


class Places(NamedTuple):
    """The truth of a reconstruction's points."""

    xyz: Floats
    """(count, 3) true places; NaN where not known."""
    z: Floats
    """(m,) true depth of each observation; NaN where not known, or on what moves by itself."""
    moves: Mask
    """(m,) the observation is known to be on what moves by itself."""
    known: Mask
    """(m,) there is a true depth map of the frame, and the observation is clear of its jumps."""


def measure(shot: Reconstruction, truth: Truth) -> Figures:
    """All figures of a solve; those that cannot be had are NaN."""
    frames = len(truth.cameras)
    index = shot.frames - 1
    rotation = np.array([image.rotation for image in shot.images])
    centres = np.array([image.centre for image in shot.images])
    turn = rotation_errors(rotation, truth.cameras.rotation[index])
    off = position_errors(centres, truth.cameras.centres[index])
    count = np.zeros(frames)
    count[index] = [len(image.points) for image in shot.images]
    focal = np.array([shot.intrinsics(image).fx for image in shot.images]) / truth.focals[index] - 1
    seen = observations(shot)
    places = true_places(seen, truth, len(shot.points))
    depth = _share_off(seen.z, places.z)
    drawn = np.isfinite(places.xyz[seen.point, 0]) & ~places.moves
    drift = truth.project(places.xyz[seen.point[drawn]], seen.frame[drawn]) - seen.xy[drawn]
    depths = np.concatenate([d[np.isfinite(d)] for d in truth.depth.values()])
    rms = float(np.sqrt((off**2).mean()))
    axis = truth.cameras.rotation[frames // 2, 2]
    changes = length_changes(shot.points.xyz, places.xyz, axis)
    at_best = length_changes(triangulated(seen, truth, len(shot.points)), places.xyz, axis)
    return Figures(
        registered=len(index) / frames,
        points_median=float(np.median(count)),
        points_least=float(count.min()),
        grid=sum(grid_share(image, truth.cameras) for image in shot.images) / frames,
        rotation_median=float(np.median(turn)),
        rotation_max=float(turn.max()),
        position_path=100 * _ratio(rms, extent(truth.cameras.centres)),
        position_depth=100 * _ratio(rms, float(np.median(depths))),
        focal=100 * float(focal[np.abs(focal).argmax()]),
        lengths=100 * float(np.expm1(_percentile(np.abs(changes), 50))),
        lengths_floor=100 * float(np.expm1(_percentile(np.abs(at_best), 50))),
        stretch=100 * float(np.expm1(_percentile(changes, 50))),
        inverse_depth=100 * _percentile(np.abs(depth.relative), 50),
        inverse_depth_90=100 * _percentile(np.abs(depth.relative), 90),
        disc=100 * _percentile(np.abs(depth.of_range), 50),
        track_px=_percentile(np.linalg.norm(drift, axis=1), 50),
        on_moving_object=float(places.moves.sum()) / max(int(places.known.sum()), 1),
        measured=int(np.isfinite(places.xyz[:, 0]).sum()),
    )


# Poses


def rotation_errors(estimated: Floats, true: Floats) -> Floats:
    """(N,) degrees between world-to-camera rotations (N, 3, 3) after the best turn of the whole world.

    The turn is the chordal mean of the differences: Hartley et al., "Rotation averaging", 2013.
    """
    difference = np.swapaxes(true, 1, 2) @ estimated
    u, _, vt = np.linalg.svd(difference.sum(axis=0))
    world = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    left = np.linalg.norm(estimated - true @ world, axis=(1, 2))
    # The chord of an angle is accurate for small ones, where the trace is not.
    return np.asarray(np.degrees(2 * np.arcsin(np.clip(left / np.sqrt(8), 0, 1))))


def position_errors(estimated: Floats, true: Floats) -> Floats:
    """(N,) distances, in the true unit, between points (N, 3) after the best similarity: Umeyama, 1991."""
    a, b = estimated - estimated.mean(axis=0), true - true.mean(axis=0)
    u, values, vt = np.linalg.svd(b.T @ a)
    flip = np.array([1.0, 1.0, np.linalg.det(u @ vt)])
    scale = _ratio(float((values * flip).sum()), float((a**2).sum()))
    moved = scale * a @ (u * flip @ vt).T if np.isfinite(scale) else np.zeros_like(b)
    return np.asarray(np.linalg.norm(moved - b, axis=1))


def extent(points: Floats) -> float:
    """The largest distance between two of some points (N, 3)."""
    return float(np.linalg.norm(points[:, None] - points[None], axis=-1).max())


# Points


def grid_share(image: Image, cameras: Cameras) -> float:
    """Share of the grid's cells that hold a point of the image."""
    across, down = GRID
    cell = np.floor(image.xy * GRID / [cameras.width, cameras.height]).astype(int)
    cell = np.clip(cell, 0, [across - 1, down - 1])
    return len(np.unique(cell[:, 1] * across + cell[:, 0])) / (across * down)


def observations(shot: Reconstruction) -> Seen:
    """All observations of a reconstruction, flattened, sorted by frame."""
    images = shot.images
    return Seen(
        np.concatenate([np.full(len(image.points), image.frame) for image in images]).astype(np.int64),
        np.concatenate([image.xy for image in images]),
        np.concatenate([image.points for image in images]).astype(np.int64),
        np.concatenate([image.to_camera(shot.points.xyz[image.points])[:, 2] for image in images]),
    )


def true_places(seen: Seen, truth: Truth, count: int) -> Places:
    """Where the `count` points that were seen truly are, by the depth at the pixels where they were seen.

    Of a point's observations that are clear of depth jumps the middle one in time is taken: a track may drift
    towards its ends.
    """
    z = np.full(len(seen.frame), np.nan)
    moves, known = np.zeros(len(z), bool), np.zeros(len(z), bool)
    for frame, depth in truth.depth.items():
        rows = np.nonzero(seen.frame == frame)[0]
        column, row = np.clip(seen.xy[rows].astype(int), 0, np.array(depth.shape)[::-1] - 1).T
        clear = np.isfinite(depth[row, column]) & ~jumps(depth)[row, column]
        known[rows] = clear
        moves[rows] = clear & truth.moves[frame][row, column]
        z[rows] = np.where(clear & ~moves[rows], _at(depth, seen.xy[rows]), np.nan)
    rows = np.nonzero(np.isfinite(z))[0]
    rows = rows[np.lexsort((seen.frame[rows], seen.point[rows]))]
    point, first, views = np.unique(seen.point[rows], return_index=True, return_counts=True)
    chosen = rows[first + views // 2]
    xyz = np.full((count, 3), np.nan)
    xyz[point] = _in_world(seen.xy[chosen], z[chosen], seen.frame[chosen], truth)
    # A point that was also seen on what moves has no place.
    xyz[seen.point[moves]] = np.nan
    return Places(xyz, z, moves, known)


def jumps(depth: Floats) -> Mask:
    """(H, W) the pixels of a true depth map within `CLEAR` of a jump."""
    with np.errstate(divide="ignore"):
        return edge_band(1 / depth, 2 * CLEAR + 1, JUMP)


def length_changes(estimated: Floats, true: Floats, axis: Floats) -> Floats:
    """(k,) log of how ratios of a length along the view to one across it differ from the true ratios.

    Points are (n, 3), NaN where not known; `axis` (3,) is the view's direction in the true world. Lengths are
    distances of random pairs of points, those that run most nearly along the view and most nearly across it.
    A ratio of two lengths has no scale. A depth that is too long by 10 % gives log 1.1 throughout. Empty
    where there are too few points.
    """
    known = np.nonzero(np.isfinite(true[:, 0]) & np.isfinite(estimated[:, 0]))[0]
    if len(known) < LEAST_POINTS:
        return np.zeros(0)
    rng = np.random.default_rng(0)
    first, second = known[rng.integers(len(known), size=(2, PAIRS))]
    apart = true[second] - true[first]
    length = np.linalg.norm(apart, axis=1)
    clear = length > APART * np.median(length)
    first, second, apart, length = first[clear], second[clear], apart[clear], length[clear]
    order = np.argsort(np.abs(apart @ axis) / length)
    some = max(1, round(PURE * len(order)))
    with np.errstate(divide="ignore"):
        change = np.log(np.linalg.norm(estimated[second] - estimated[first], axis=1) / length)
    across, along = (rows[length[rows] >= np.median(length[rows])] for rows in (order[:some], order[-some:]))
    count = min(len(across), len(along))
    return np.asarray(change[rng.permutation(along)[:count]] - change[rng.permutation(across)[:count]])


def triangulated(seen: Seen, truth: Truth, count: int) -> Floats:
    """(count, 3) where the rays of a point's observations come closest, the cameras being the true ones.

    NaN for points that are not seen, or from one place only.
    """
    index = seen.frame - 1
    far = _in_world(seen.xy, np.ones(len(index)), seen.frame, truth)
    centres = truth.cameras.centres[index]
    rays = (far - centres) / np.linalg.norm(far - centres, axis=1, keepdims=True)
    away = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    system, right = np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(system, seen.point, away)
    np.add.at(right, seen.point, np.einsum("mij,mj->mi", away, centres))
    good = np.linalg.eigvalsh(system)[:, 0] > 1e-9
    xyz = np.full((count, 3), np.nan)
    xyz[good] = np.linalg.solve(system[good], right[good][..., None])[..., 0]
    return xyz


class _DepthError(NamedTuple):
    relative: Floats
    of_range: Floats


def _share_off(estimated: Floats, true: Floats) -> _DepthError:
    """Errors of inverse depth of observations (m,) after the best scale; NaN is left out."""
    good = np.isfinite(true) & (estimated > 0)
    if good.sum() < 2:
        return _DepthError(np.zeros(0), np.zeros(0))
    ratio = true[good] / estimated[good]
    relative = ratio / np.median(ratio) - 1
    low, high = np.percentile(1 / true[good], [5, 95])
    return _DepthError(relative, relative / true[good] / (high - low) if high > low else np.zeros(0))


def _in_world(xy: Floats, z: Floats, frame: NDArray[np.int64], truth: Truth) -> Floats:
    """Pixels (m, 2) at true depths (m,) in their frames (m,) -> world (m, 3)."""
    cameras, index = truth.cameras, frame - 1
    middle = np.array([cameras.width, cameras.height]) / 2
    local = np.column_stack([(xy - middle) / truth.focals[index, None], np.ones(len(xy))]) * z[:, None]
    world = np.einsum("mji,mj->mi", cameras.rotation[index], local - cameras.translation[index])
    return np.asarray(world, dtype=np.float64)


def _at(depth: Floats, xy: Floats) -> Floats:
    """Depth (n,) at pixels (n, 2), inverse depth being linear between pixel centres."""
    height, width = depth.shape
    column, row = np.clip(xy - 0.5, 0, [width - 1.001, height - 1.001]).T
    left, top = column.astype(int), row.astype(int)
    x, y = column - left, row - top
    inverse = 1 / depth
    upper = (1 - x) * inverse[top, left] + x * inverse[top, left + 1]
    lower = (1 - x) * inverse[top + 1, left] + x * inverse[top + 1, left + 1]
    with np.errstate(divide="ignore"):
        return np.asarray(1 / ((1 - y) * upper + y * lower))


def _percentile(values: Floats, share: float) -> float:
    return float(np.percentile(values, share)) if len(values) else float("nan")


def _ratio(above: float, below: float) -> float:
    # Of metres: a path of rounding errors is none.
    return above / below if below > 1e-9 else float("nan")
