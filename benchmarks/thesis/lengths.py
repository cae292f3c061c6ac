"""Measured edges against estimated ones (the thesis's section 4.4): ratios of lengths to the first edge.

The corners are marked by hand in some frames, to a whole pixel, or in one frame and followed through the clip
by optical flow, and triangulated with the solved cameras. The first asks whether the cameras are right, the
second also whether a corner can be followed, which has a moving background on one side.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, Ints
from addon.core.camera.reconstruction import Reconstruction
from addon.core.media.clip import Footage
from addon.core.media.light import to_gray8
from addon.core.sfm.tracking.klt import follow
from sample_scenes.stage import Edge, Stage

Mask = NDArray[np.bool_]

SURFACE = 0.01
"""Share of its depth within which the corner's own surface must be seen around it, or it is hidden."""
TOLERANCE = 1.0
"""Pixels of reprojection error from where an observation loses weight (Huber)."""
STEPS = 30


def corners_of(edges: tuple[Edge, ...]) -> tuple[Floats, Ints]:
    """The distinct ends (k, 3) of the edges, and the rows (e, 2) of each edge's two."""
    ends = np.concatenate([edge.ends for edge in edges])
    world, row = np.unique(np.round(ends, 9), axis=0, return_inverse=True)
    return world, row.reshape(-1, 2).astype(np.int32)


def visible(stage: Stage, depth: Floats, index: int, world: Floats) -> Mask:
    """(k,) whether corners are seen in a frame (from 0), by its true depth map (H, W)."""
    at = stage.cameras.project(world)[index]
    z = stage.cameras.to_camera(world)[index, :, 2]
    height, width = depth.shape
    inside = np.all((at >= 2) & (at < [width - 2, height - 2]), axis=1)
    column, row = np.clip(at.astype(int), 1, [width - 2, height - 2]).T
    # The corner is on a silhouette: one of the pixels around it must be of its surface.
    shift = np.array([-1, 0, 1])
    around = depth[row[:, None, None] + shift[:, None], column[:, None, None] + shift]
    near = np.abs(around - z[:, None, None]) < SURFACE * z[:, None, None]
    return np.asarray(inside & near.any(axis=(1, 2)))


def clicked(stage: Stage, depth: dict[int, Floats], world: Floats) -> Floats:
    """(F, k, 2) the corners as a hand marks them in the frames (from 1) of `depth`, their true depth maps.

    A click is on the middle of a whole pixel. NaN where a corner is hidden and in all other frames.
    """
    at = stage.cameras.project(world)
    marks = np.full(at.shape, np.nan)
    for frame, seen in depth.items():
        own = visible(stage, seen, frame - 1, world)
        marks[frame - 1, own] = np.floor(at[frame - 1, own]) + 0.5
    return marks


def nearest_mark(marks: Floats, index: int) -> Ints:
    """(k,) of the frames that a corner is marked in, (F, k, 2), that nearest to `index`; -1 without any."""
    known = np.isfinite(marks[..., 0])
    away = np.where(known, np.abs(np.arange(len(marks)) - index)[:, None], len(marks))
    return np.where(known.any(axis=0), away.argmin(axis=0), -1).astype(np.int32)


def followed(footage: Footage, start: Ints, xy: Floats) -> Floats:
    """(F, k, 2) where flow puts points that are at (k, 2) in the frames of index `start` (k,); NaN if lost.

    Points whose start is negative are in no frame. Pixels count from the first one's corner.
    """
    gray = [to_gray8(footage.read(frame)) for frame in footage.frames]
    found = np.full((len(gray), len(start), 2), np.nan)
    for first in np.unique(start[start >= 0]):
        own = np.nonzero(start == first)[0]
        found[first, own] = xy[own]
        for way in (1, -1):
            kept, places = own, (xy[own] - 0.5).astype(np.float32)
            for index in range(int(first) + way, len(gray) if way > 0 else -1, way):
                places, stays = follow(gray[index - way], gray[index], places)
                kept = kept[stays]
                found[index, kept] = places.astype(np.float64) + 0.5
    return found


def triangulated(reconstruction: Reconstruction, xy: Floats) -> tuple[Floats, Floats]:
    """Points (k, 3) that the F images of a reconstruction see at pixels (F, k, 2), and their misses (F, k).

    NaN is what is not seen, and a point seen by fewer than two images. Minimises the reprojection error in
    pixels with Huber weights, by linear equations reweighted by depth (Hartley and Sturm, "Triangulation",
    1997).
    """
    images = reconstruction.images
    lenses = [reconstruction.intrinsics(image) for image in images]
    rotation = np.stack([image.rotation for image in images])
    translation = np.stack([image.translation for image in images])
    rays = np.stack([
        (lens.pinhole_pixels(seen) - lens.principal_point) / lens.focal
        for lens, seen in zip(lenses, xy, strict=True)
    ])  # fmt: skip
    focal = np.stack([lens.focal for lens in lenses])
    seen = np.isfinite(rays).all(axis=2)
    rays = np.where(seen[..., None], rays, 0.0)
    # Two equations an observation: (r_x - x r_z) X = x t_z - t_x, in pixels at unit depth.
    rows = focal[:, None, :, None] * (rotation[:, None, :2] - rays[..., None] * rotation[:, None, 2:])
    values = focal[:, None] * (rays * translation[:, None, 2:] - translation[:, None, :2])
    weight = seen.astype(np.float64)
    enough = seen.sum(axis=0) >= 2
    points = np.full((xy.shape[1], 3), np.nan)
    miss = np.full(seen.shape, np.nan)
    for _ in range(STEPS):
        normal = np.einsum("fk,fkji,fkjl->kil", weight, rows, rows)
        right = np.einsum("fk,fkji,fkj->ki", weight, rows, values)
        points[enough] = np.linalg.solve(normal[enough], right[enough][..., None])[..., 0]
        depth = np.einsum("fi,ki->fk", rotation[:, 2], points) + translation[:, None, 2]
        miss = np.linalg.norm(np.einsum("fkji,ki->fkj", rows, points) - values, axis=2) / np.abs(depth)
        miss = np.where(seen, miss, np.nan)
        huber = np.minimum(1.0, TOLERANCE / np.maximum(np.nan_to_num(miss), 1e-12))
        weight = np.where(seen & enough, huber / np.nan_to_num(depth, nan=1.0) ** 2, 0.0)
    return points, miss


def lengths(points: Floats, edges: Ints) -> Floats:
    """(e,) distances between the rows (e, 2) of points (k, 3)."""
    return np.asarray(np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1))


def similarity(source: Floats, target: Floats) -> tuple[float, Floats, Floats]:
    """Scale, rotation (3, 3) and translation (3,) that bring points (k, 3) onto others best.

    Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991.
    """
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, values, vt = np.linalg.svd(b.T @ a)
    flip = np.array([1.0, 1.0, np.linalg.det(u @ vt)])
    rotation = (u * flip) @ vt
    scale = float((values * flip).sum() / (a**2).sum())
    return scale, rotation, target.mean(axis=0) - scale * rotation @ source.mean(axis=0)
