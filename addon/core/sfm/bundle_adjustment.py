"""Bundle adjustment in numpy, where solver libraries have gaps.

It supports points at any distance, focal lengths that change from frame to frame, and a realistic covariance
for tracked video. Points are homogeneous, so that infinity is not a special case. Triggs, McLauchlan, Hartley
and Fitzgibbon, "Bundle adjustment: a modern synthesis", 2000.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, Ints
from .distortion import SIGMA, Distortion


@dataclass(frozen=True)
class AdjustmentOptions:
    """When an adjustment ends. Chosen by inspection."""

    steps: int = 60
    """Steps of Levenberg's and Marquardt's method at most, rejected ones included."""
    settled: float = 1e-7
    """Relative fall of the cost in one step at which it is enough."""


@dataclass(frozen=True)
class Observations:
    """Where points are seen: m observations, sorted in any way, at most one of a point in a frame."""

    frame: Ints
    """(m,) 0 to F - 1."""
    point: Ints
    """(m,) 0 to P - 1."""
    xy: Floats
    """(m, 2) pixels from the principal point."""


@dataclass(frozen=True)
class Bundle:
    """Cameras and points, in any units."""

    rotation: Floats
    """(F, 3, 3) world-to-camera."""
    translation: Floats
    """(F, 3)"""
    points: Floats
    """(P, 4) homogeneous, of unit length."""
    focal: Floats
    """(F,) pixels."""
    distortion: Distortion | None = None
    """None for pinholes that read a picture at once."""

    @property
    def world(self) -> Floats:
        """(P, 3) points; not finite where they are infinitely far."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.points[:, :3] / self.points[:, 3:])

    def in_camera(self, seen: Observations) -> Floats:
        """Return (m, 3) each observation's point in its camera's axes, times its own homogeneous factor."""
        turned = np.einsum("mij,mj->mi", self.rotation[seen.frame], self.points[seen.point, :3])
        local = np.asarray(turned + self.points[seen.point, 3:] * self.translation[seen.frame])
        return local if self.distortion is None else self.distortion.turned(local, seen.frame, seen.xy)

    def residuals(self, seen: Observations) -> Floats:
        """Return (m, 2) projection minus observation, in pixels."""
        local = self.in_camera(seen)
        with np.errstate(divide="ignore", invalid="ignore"):
            place = self.focal[seen.frame, None] * local[:, :2] / local[:, 2:]
        return np.asarray((place if self.distortion is None else self.distortion.bent(place)) - seen.xy)


@dataclass(frozen=True)
class Adjusted:
    """The outcome."""

    bundle: Bundle
    cost: float
    """Sum of the robust squared errors, in pixels squared."""
    error: float
    """Root mean square of the robust residuals, per coordinate, in pixels."""
    influence: Floats
    """(m, n) influence of each observation on the common parameters: the logarithm of a common focal length,
    then the distortion's parameters, 0 for held ones. Not finite if they are undetermined; (m, 0) without
    common parameters, or if each frame has its own focal length."""
    point: Ints
    """(m,) of the observations."""

    @property
    def focal_sigma(self) -> float:
        """Relative standard deviation of the common focal length; 0 where nothing is common."""
        return float(np.sqrt(self.covariance(self.point)[0, 0])) if self.influence.shape[1] else 0.0

    def covariance(self, unit: Ints) -> Floats:
        """Return the covariance (n, n) of the common parameters, with independent units of observations.

        A tracked feature has the same error in successive frames; the usual covariance assumes independent
        observations and is several times too small. Liang and Zeger, "Longitudinal data analysis using
        generalized linear models", 1986 (the sandwich estimator).

        Args:
            unit: (m,) unit of each observation.
        """
        _, number = np.unique(unit, return_inverse=True)
        with np.errstate(over="ignore", invalid="ignore"):
            moved = summed(self.influence, number.astype(np.int32), int(number.max()) + 1)
            return np.asarray(moved.T @ moved)


@dataclass(frozen=True)
class _System:
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


def adjust(
    bundle: Bundle,
    seen: Observations,
    loss: float,
    free_focal: str = "held",
    tie: float = 0.0,
    options: AdjustmentOptions = AdjustmentOptions(),
) -> Adjusted:
    """Adjust all poses and points by Levenberg and Marquardt, with Huber's loss.

    Cameras in one place, the origin, with all points at infinity, stay there.

    Args:
        bundle: Start of the adjustment. Its distortion is adjusted, too; one standard deviation of its prior
            costs as much as an observation with an error of `loss`.
        seen: The observations.
        loss: Pixels from which the loss is linear.
        free_focal: "held", "common" (one factor for all frames) or "each" (one for each frame).
        tie: Cost of a change between neighbours with "each", in pixels squared for the square of its
            logarithm.
        options: Limits.
    """
    frames = len(bundle.focal)
    extra = {"held": 0, "common": 1, "each": frames}[free_focal]
    damping = 1e-4
    system = _system(bundle, seen, loss, extra, tie)
    for _ in range(options.steps):
        step = _solved(system, damping)
        if step is not None:
            moved = _moved(bundle, system.basis, *step, extra)
            cost = _cost(moved, seen, loss, tie)
            if cost < system.cost:
                fallen = (system.cost - cost) / max(system.cost, 1e-300)
                bundle, damping = moved, max(damping / 8, 1e-10)
                system = _system(bundle, seen, loss, extra, tie)
                if fallen < options.settled:
                    break
                continue
        damping *= 6
        if damping > 1e8:
            break
    count = max(2 * len(seen.frame) - 6 * frames - 3 * len(bundle.points), 1)
    error = float(np.sqrt(system.cost / count))
    return Adjusted(bundle, system.cost, error, _influence(system, seen, frames), seen.point)


def weights(residuals: Floats, loss: float) -> tuple[Floats, float]:
    """Return Huber's weights (m,) and the cost."""
    size = np.linalg.norm(residuals, axis=1)
    bad = ~np.isfinite(size)
    size = np.where(bad, 1e6, size)
    weight = np.where(size <= loss, 1.0, loss / np.maximum(size, loss))
    cost = float(np.where(size <= loss, size**2, 2 * loss * size - loss**2).sum())
    return np.where(bad, 0.0, weight), cost


def _cost(bundle: Bundle, seen: Observations, loss: float, tie: float) -> float:
    cost = weights(_residuals(bundle, seen), loss)[1]
    cost += tie * float((np.diff(np.log(bundle.focal)) ** 2).sum())
    if bundle.distortion is not None:
        cost += float(((bundle.distortion.parameters * loss / SIGMA) ** 2).sum())
    return cost


def _residuals(bundle: Bundle, seen: Observations) -> Floats:
    """(m, 2) pixels; NaN behind the camera, from where a point would fit as well."""
    residuals = bundle.residuals(seen)
    residuals[bundle.in_camera(seen)[:, 2] <= 0] = np.nan
    return residuals


def _system(bundle: Bundle, seen: Observations, loss: float, extra: int, tie: float) -> _System:
    frames, count = len(bundle.focal), len(bundle.points)
    local = bundle.in_camera(seen)
    residuals = _residuals(bundle, seen)
    weight, _ = weights(residuals, loss)
    root = np.sqrt(weight)[:, None]
    residuals = root * np.nan_to_num(residuals)
    camera, point, basis = pose_derivatives(bundle, seen, local)
    bent = None
    if bundle.distortion is not None:
        ahead = np.where(local[:, 2:] > 0, local, [0.0, 0.0, 1.0])
        by_place, bent = bundle.distortion.derivatives(ahead, bundle.focal[seen.frame], seen.frame, seen.xy)
        camera, point, bent = by_place @ camera, by_place @ point, root[..., None] * bent
    camera *= root[..., None]
    point *= root[..., None]
    if extra == 0:
        camera[..., 6] = 0
    columns = 6 * frames + extra + (0 if bent is None else len(SIGMA))
    last = 6 * frames + (seen.frame if extra == frames and extra > 1 else np.zeros_like(seen.frame))
    cross = np.zeros((count, 3, columns))
    blocks = np.einsum("mki,mkj->mij", point, camera)
    at = 6 * seen.frame[:, None] + np.arange(6)
    cross[seen.point[:, None, None], np.arange(3)[:, None], at[:, None, :]] = blocks[..., :6]
    full = np.zeros((columns, columns))
    right = np.zeros(columns)
    own = summed(np.einsum("mki,mkj->mij", camera, camera), seen.frame, frames)
    own_right = summed(np.einsum("mki,mk->mi", camera, residuals), seen.frame, frames)
    place = 6 * np.arange(frames)[:, None] + np.arange(6)
    full[place[:, :, None], place[:, None, :]] = own[:, :6, :6]
    right[: 6 * frames] = own_right[:, :6].ravel()
    if extra:
        np.add.at(cross, (seen.point[:, None], np.arange(3), last[:, None]), blocks[..., 6])
        lasts = 6 * frames + (np.arange(frames) if extra == frames and extra > 1 else np.zeros(frames, int))
        np.add.at(full, (lasts, lasts), own[:, 6, 6])
        np.add.at(full, (place, lasts[:, None]), own[:, :6, 6])
        np.add.at(full, (lasts[:, None], place), own[:, :6, 6])
        np.add.at(right, lasts, own_right[:, 6])
    if extra == frames and tie:
        change = np.diff(np.eye(frames), axis=0)
        zooms = slice(6 * frames, 6 * frames + extra)
        full[zooms, zooms] += tie * change.T @ change
        right[zooms] += tie * change.T @ np.diff(np.log(bundle.focal))
    if bundle.distortion is not None and bent is not None:
        lens = columns - len(SIGMA) + np.arange(len(SIGMA))
        mixed = summed(np.einsum("mki,mkj->mij", camera, bent), seen.frame, frames)
        np.add.at(full, (place[:, :, None], lens), mixed[:, :6])
        if extra:
            np.add.at(full, (lasts[:, None], lens), mixed[:, 6])
        full[lens] = full[:, lens].T
        full[lens[:, None], lens] = np.einsum("mki,mkj->ij", bent, bent) + np.diag((loss / SIGMA) ** 2)
        right[lens] = np.einsum("mki,mk->i", bent, residuals)
        right[lens] += (loss / SIGMA) ** 2 * bundle.distortion.parameters
        cross[..., lens] = summed(np.einsum("mki,mkj->mij", point, bent), seen.point, count)
    common = camera[..., 6 : 6 + (extra == 1)]
    common = common if bent is None else np.concatenate([common, bent], axis=2)
    return _System(
        _cost(bundle, seen, loss, tie), full, right,
        summed(np.einsum("mki,mkj->mij", point, point), seen.point, count),
        summed(np.einsum("mki,mk->mi", point, residuals), seen.point, count), cross, basis,
        (camera[..., :6], common, point, residuals),
    )  # fmt: skip


def pose_derivatives(bundle: Bundle, seen: Observations, local: Floats) -> tuple[Floats, Floats, Floats]:
    """Derivatives of projections by (turn, shift, log of the focal length), by points, and tangents.

    Shapes are (m, 2, 7) and (m, 2, 3).
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


def summed(values: Floats, index: Ints, count: int) -> Floats:
    """Return (count, ...) sums of (m, ...) by index (m,)."""
    order = np.argsort(index, kind="stable")
    numbers, starts = np.unique(index[order], return_index=True)
    result = np.zeros((count, *values.shape[1:]))
    if len(numbers):
        result[numbers] = np.add.reduceat(values[order], starts, axis=0)
    return result


def _solved(system: _System, damping: float) -> tuple[Floats, Floats] | None:
    """The step of cameras (C,) and points (P, 3), points eliminated (Schur's complement)."""
    diagonal = np.einsum("pii->pi", system.point)
    heavy = system.point + np.eye(3) * (damping * diagonal + 1e-12)[:, None, :]
    own = np.einsum("ii->i", system.cameras)
    try:
        factor = np.linalg.inv(np.linalg.cholesky(heavy))
        half = factor @ np.concatenate([system.cross, system.point_right[..., None]], axis=2)
        flat = half.reshape(-1, half.shape[2])
        product = flat[:, :-1].T @ flat
        reduced = system.cameras - product[:, :-1]
        reduced[np.diag_indices_from(reduced)] += damping * own + 1e-12
        # The first camera stays in place: the drift of the whole scene is undetermined.
        reduced[:6], reduced[:, :6] = 0, 0
        reduced[np.arange(6), np.arange(6)] = 1
        product[:6, -1] = system.right[:6]
        cameras = np.linalg.solve(reduced, product[:, -1] - system.right)
    except np.linalg.LinAlgError:
        return None
    rest = -half[..., -1] - half[..., :-1] @ cameras
    return cameras, np.einsum("pji,pj->pi", factor, rest)


def _moved(bundle: Bundle, basis: Floats, cameras: Floats, points: Floats, extra: int) -> Bundle:
    frames = len(bundle.focal)
    pose = cameras[: 6 * frames].reshape(frames, 6).copy()
    if extra == 1:
        change = float(np.clip(cameras[6 * frames], -0.3, 0.3))
        bundle, shift, slide = stretched(bundle, change)
        pose[:, 3:] -= change * shift
        points = points - change * np.einsum("pij,pi->pj", basis, slide)
    elif extra:
        zoomed = np.exp(np.clip(cameras[6 * frames : 7 * frames], -0.3, 0.3))
        bundle = replace(bundle, focal=bundle.focal * zoomed)
    if bundle.distortion is not None:
        bundle = replace(bundle, distortion=bundle.distortion.changed(cameras[-len(SIGMA) :]))
    turn = turns(pose[:, :3])
    placed = bundle.points + np.einsum("pij,pj->pi", basis, points)
    return replace(
        bundle,
        rotation=turn @ bundle.rotation,
        translation=np.einsum("fij,fj->fi", turn, bundle.translation) + pose[:, 3:],
        points=placed / np.linalg.norm(placed, axis=1, keepdims=True),
    )


def stretched(bundle: Bundle, change: float) -> tuple[Bundle, Floats, Floats]:
    """The focal length changed by the factor exp(`change`), and the scene in depth, so that pictures stay.

    It is stretched along the first camera's axis, which cameras that look alike see nothing of. On its own, a
    step of the focal length would at once leave the narrow, curved valley in which it is determined. Beside
    it, (F, 3) and (P, 4), how translations and points begin to move.
    """
    ahead = bundle.rotation[0, 2]
    centres = -np.einsum("fji,fj->fi", bundle.rotation, bundle.translation)
    shift = -bundle.rotation @ ahead * ((centres - centres[0]) @ ahead)[:, None]
    slide = np.zeros_like(bundle.points)
    slide[:, :3] = ahead * ((bundle.points[:, :3] - bundle.points[:, 3:] * centres[0]) @ ahead)[:, None]
    points = bundle.points + np.expm1(change) * slide
    return (
        replace(
            bundle, focal=bundle.focal * np.exp(change),
            translation=bundle.translation + np.expm1(change) * shift,
            points=points / np.linalg.norm(points, axis=1, keepdims=True),
        ),
        shift, slide,
    )  # fmt: skip


def turns(vectors: Floats) -> Floats:
    """Return (F, 3) axes times angles -> (F, 3, 3) rotations (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros(len(x))
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    safe = np.where(angle > 0, angle, 1.0)
    one = np.where(angle > 1e-8, np.sin(safe) / safe, 1.0)
    two = np.where(angle > 1e-4, (1 - np.cos(safe)) / safe**2, 0.5)
    return np.asarray(np.eye(3) + one * cross + two * cross @ cross)


def _influence(system: _System, seen: Observations, frames: int) -> Floats:
    """As `Adjusted.influence`."""
    pose, common, point, residual = system.per_observation
    wanted = common.shape[2]
    if not wanted or len(system.cameras) != 6 * frames + wanted:
        return np.zeros((len(residual), 0))
    # Points at infinity have an undetermined freedom.
    heavy = system.point + np.eye(3) * (1e-10 * np.einsum("pii->p", system.point) + 1e-12)[:, None, None]
    solved = np.linalg.inv(heavy) @ system.cross
    flat, crossed = solved.reshape(-1, solved.shape[2]), system.cross.reshape(-1, system.cross.shape[2])
    reduced = system.cameras - crossed.T @ flat
    # Place, turn and scale of the scene are free, and independent of the common parameters.
    diagonal = np.einsum("ii->i", reduced)
    reduced[np.diag_indices_from(reduced)] += 1e-9 * (diagonal + diagonal.mean())
    try:
        inverse = np.linalg.solve(reduced, np.eye(len(reduced))[:, -wanted:])
    except np.linalg.LinAlgError:
        return np.full((len(residual), wanted), np.inf)
    with np.errstate(over="ignore", invalid="ignore"):
        # Each observation's part in the reduced gradient: by its camera, and by its point's other cameras.
        by_pose = np.einsum(
            "mki,miw->mkw", pose, inverse[: 6 * frames].reshape(frames, 6, wanted)[seen.frame]
        )
        by_point = np.einsum("mki,miw->mkw", point, (solved @ inverse)[seen.point])
        each = by_pose + common @ inverse[-wanted:] - by_point
        return np.asarray(np.einsum("mkw,mk->mw", each, residual))
