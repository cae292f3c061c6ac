"""Normal equations of a bundle adjustment."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...base.arrays import Floats, Ints
from .bundle import SIGMA, Bundle, Observations, prior_cost, robust_residuals, weights


@dataclass(frozen=True)
class System:
    """The normal equations, points eliminated as far as `steps` needs."""

    cost: float
    cameras: Floats
    """(C, C)"""
    right: Floats
    """(C,)"""
    point: Floats
    """(P, 3, 3)"""
    point_right: Floats
    """(P, 3)"""
    cross: Floats
    """(P, 3, C)"""
    basis: Floats
    """(P, 4, 3) tangents of the points."""
    per_observation: tuple[Floats, Floats, Floats, Floats]
    """Weighted (m, 2, 6) pose, (m, 2, c) common and (m, 2, 3) point derivatives and (m, 2) residuals."""


@dataclass(frozen=True)
class Groups:
    """Rows grouped by a number."""

    order: Ints
    """(m,) rows sorted by their numbers."""
    numbers: Ints
    """(k,) numbers with rows, ascending."""
    starts: Ints
    """(k,) their first places in `order`."""
    count: int
    """Number of all groups."""

    @classmethod
    def of(cls, index: Ints, count: int) -> Groups:
        """Group rows by their numbers (m,), 0 to `count` - 1."""
        order = np.argsort(index, kind="stable")
        numbers, starts = np.unique(index[order], return_index=True)
        return cls(order.astype(np.int32), numbers, starts.astype(np.int32), count)

    def sums(self, values: Floats) -> Floats:
        """Return the sums (count, ...) of values (m, ...) in each group."""
        result = np.zeros((self.count, *values.shape[1:]))
        if len(self.numbers):
            result[self.numbers] = np.add.reduceat(values[self.order], self.starts, axis=0)
        return result


def summed(values: Floats, index: Ints, count: int) -> Floats:
    """Return (count, ...) sums of (m, ...) by index (m,)."""
    return Groups.of(index, count).sums(values)


def _grams(rows: Floats, frame: Ints, frames: int) -> Floats:
    """Return the Gram matrices (F, n, n) of each frame's rows (m, 2, n), sorted by frame (m,)."""
    ends = np.searchsorted(frame, np.arange(frames + 1)).tolist()
    parts = (rows[a:b].reshape(-1, rows.shape[2]) for a, b in pairwise(ends))
    return np.stack([part.T @ part for part in parts])


def normal_equations(
    bundle: Bundle, seen: Observations, points: Groups, loss: float, extra: int, tie: float
) -> System:
    """Return the normal equations of an adjustment.

    Args:
        bundle: Cameras and points.
        seen: Observations, sorted by frame.
        points: Observations grouped by point.
        loss: Pixels from which the loss is linear.
        extra: Number of free focal lengths: 0, 1 or that of the frames.
        tie: As in `adjust`.
    """
    frames, lens = len(bundle.focal), 0 if bundle.distortion is None else len(SIGMA)
    residuals, local = robust_residuals(bundle, seen)
    weight, cost = weights(residuals, loss)
    root = np.sqrt(weight)[:, None]
    camera, point, basis = pose_derivatives(bundle, seen, local)
    bent = np.zeros((len(local), 2, 0))
    if bundle.distortion is not None:
        ahead = np.where(local[:, 2:] > 0, local, [0.0, 0.0, 1.0])
        by_place, bent = bundle.distortion.derivatives(ahead, bundle.focal[seen.frame], seen.frame, seen.xy)
        camera, point = by_place @ camera, by_place @ point
    if extra == 0:
        camera[..., 6] = 0
    # Pose, focal length, distortion and residual of an observation in one row.
    rows = np.concatenate([camera, bent, np.nan_to_num(residuals)[..., None]], axis=2) * root[..., None]
    point *= root[..., None]
    full, right = _camera_equations(_grams(rows, seen.frame, frames), extra, lens)
    # Points' derivatives with each column of the rows, and with each other.
    blocks = np.swapaxes(point, 1, 2) @ np.concatenate([rows, point], axis=2)
    own = points.sums(blocks[..., 7:])
    cross = np.zeros((len(bundle.points), 3, len(right)))
    at = 6 * seen.frame[:, None] + np.arange(6)
    cross[seen.point[:, None, None], np.arange(3)[:, None], at[:, None, :]] = blocks[..., :6]
    if extra == 1:
        cross[..., 6 * frames] = points.sums(blocks[..., 6])
    elif extra:
        cross[seen.point[:, None], np.arange(3), 6 * frames + seen.frame[:, None]] = blocks[..., 6]
    cross[..., len(right) - lens :] = own[..., :lens]
    if extra > 1 and tie:
        change = np.diff(np.eye(frames), axis=0)
        zooms = slice(6 * frames, 7 * frames)
        full[zooms, zooms] += tie * change.T @ change
        right[zooms] += tie * change.T @ np.diff(np.log(bundle.focal))
    if bundle.distortion is not None:
        last = len(right) - lens + np.arange(lens)
        full[last, last] += (loss / SIGMA) ** 2
        right[last] += (loss / SIGMA) ** 2 * bundle.distortion.parameters
    common = rows[..., 6 if extra == 1 else 7 : 7 + lens]
    cost += prior_cost(bundle, loss, tie)
    return System(
        cost, full, right, own[..., lens + 1 :], own[..., lens], cross, basis,
        (rows[..., :6], common, point, rows[..., -1]),
    )  # fmt: skip


def _camera_equations(grams: Floats, extra: int, lens: int) -> tuple[Floats, Floats]:
    """Normal equations of cameras, focal lengths and distortion.

    Args:
        grams: (F, n, n) sums over each frame, of pose (6), focal length, distortion and residual.
        extra: Number of focal lengths.
        lens: Number of terms of the distortion.
    """
    frames = len(grams)
    columns = 6 * frames + extra + lens
    full, right = np.zeros((columns, columns)), np.zeros(columns)
    place = 6 * np.arange(frames)[:, None] + np.arange(6)
    full[place[:, :, None], place[:, None, :]] = grams[:, :6, :6]
    right[: 6 * frames] = grams[:, :6, -1].ravel()
    if extra == 1:
        full[: 6 * frames, 6 * frames] = grams[:, :6, 6].ravel()
        full[6 * frames, 6 * frames] = grams[:, 6, 6].sum()
        right[6 * frames] = grams[:, 6, -1].sum()
    elif extra:
        each = 6 * frames + np.arange(frames)
        full[place, each[:, None]] = grams[:, :6, 6]
        full[each, each] = grams[:, 6, 6]
        right[each] = grams[:, 6, -1]
    if lens:
        last, terms = slice(columns - lens, columns), slice(7, 7 + lens)
        full[: 6 * frames, last] = grams[:, :6, terms].reshape(-1, lens)
        mixed = grams[:, 6, terms]
        if extra:
            full[6 * frames : 6 * frames + extra, last] = mixed if extra > 1 else mixed.sum(axis=0)
        full[last, last] = grams[:, terms, terms].sum(axis=0)
        right[last] = grams[:, terms, -1].sum(axis=0)
    # The lower triangle mirrors the upper one.
    below = np.tril_indices(columns, -1)
    full[below] = full.T[below]
    return full, right


def pose_derivatives(bundle: Bundle, seen: Observations, local: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the derivatives of m projections in pixels.

    Args:
        bundle: Cameras and points.
        seen: The m observations.
        local: (m, 3) their points in camera coordinates.

    Returns:
        (m, 2, 7) by the camera's turn, shift and logarithm of the focal length; (m, 2, 3) by the point along
        its tangents; and the tangents of all points.
    """
    x, y, z = np.where(local[:, 2:] > 0, local, [0.0, 0.0, 1.0]).T
    focal, w = bundle.focal[seen.frame], bundle.points[seen.point, 3]
    u, v = x / z, y / z
    camera = np.empty((len(x), 2, 7))
    # Projection by camera coordinates, and those by a small turn of the camera: -[local]x.
    camera[:, 0] = np.stack([-u * v, 1 + u * u, -v, w / z, 0 * w, -u * w / z, u], axis=1) * focal[:, None]
    camera[:, 1] = np.stack([-1 - v * v, u * v, u, 0 * w, w / z, -v * w / z, v], axis=1) * focal[:, None]
    basis = _tangents(bundle.points)
    pose = np.concatenate([bundle.rotation, bundle.translation[..., None]], axis=2)
    moved = np.einsum("mij,mjk->mik", pose[seen.frame], basis[seen.point])
    scale = (focal / z)[:, None]
    point = np.stack(
        [(moved[:, 0] - u[:, None] * moved[:, 2]) * scale, (moved[:, 1] - v[:, None] * moved[:, 2]) * scale],
        axis=1,
    )
    return camera, point, basis


def _tangents(points: Floats) -> Floats:
    """(P, 4, 3) orthonormal bases perpendicular to unit vectors (P, 4) (Householder)."""
    sign = np.where(points[:, :1] >= 0, 1.0, -1.0)
    mirror = points.copy()
    mirror[:, :1] += sign
    whole = np.eye(4) - 2 * mirror[:, :, None] * mirror[:, None] / (mirror**2).sum(axis=1)[:, None, None]
    return whole[:, :, 1:]
