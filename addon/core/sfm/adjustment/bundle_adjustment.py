"""Bundle adjustment in numpy, where solver libraries have gaps.

It supports points at any distance, focal lengths that change from frame to frame, and a realistic covariance
for tracked video. Points are homogeneous, so that infinity is not a special case. Triggs, McLauchlan, Hartley
and Fitzgibbon, "Bundle adjustment: a modern synthesis", 2000.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Floats, Ints
from .bundle import SIGMA, Bundle, Observations, cost_of
from .normal_equations import Groups, System, normal_equations, summed

STEPS = 60
"""Most steps of an adjustment, rejected ones included. Chosen by inspection."""
SETTLED = 1e-5
"""Relative fall of the cost in a step at which an adjustment ends. With 1e-7 the motions
jitter and planar of `benchmarks.solving` are solved alike, and a real clip takes 1.6 times as many steps."""


@dataclass(frozen=True)
class Adjusted:
    """The outcome."""

    bundle: Bundle
    cost: float
    """Sum of the robust squared errors, in pixels squared."""
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


def adjust(
    bundle: Bundle,
    seen: Observations,
    loss: float,
    free_focal: str = "held",
    tie: float = 0.0,
    steps: int = STEPS,
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
        steps: Most steps, rejected ones included.
    """
    frames = len(bundle.focal)
    extra = {"held": 0, "common": 1, "each": frames}[free_focal]
    order = np.argsort(seen.frame, kind="stable")
    seen = Observations(seen.frame[order], seen.point[order], seen.xy[order])
    points = Groups.of(seen.point, len(bundle.points))
    damping = 1e-4
    system = normal_equations(bundle, seen, points, loss, extra, tie)
    for _ in range(steps):
        step = _solved(system, damping)
        if step is not None:
            moved = _moved(bundle, system.basis, *step, extra)
            cost = cost_of(moved, seen, loss, tie)
            if cost < system.cost:
                fallen = (system.cost - cost) / max(system.cost, 1e-300)
                bundle, damping = moved, max(damping / 8, 1e-10)
                system = normal_equations(bundle, seen, points, loss, extra, tie)
                if fallen < SETTLED:
                    break
                continue
        damping *= 6
        if damping > 1e8:
            break
    influence, back = _influence(system, seen, frames), np.argsort(order)
    return Adjusted(bundle, system.cost, influence[back], seen.point[back])


def _solved(system: System, damping: float) -> tuple[Floats, Floats] | None:
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
    return cameras, np.einsum("pji,pj->pi", factor, -half[..., -1] - half[..., :-1] @ cameras)


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
    """Multiply the focal lengths by exp(`change`), and stretch the scene so that projections hardly change.

    The scene is stretched along the first camera's axis, to which cameras with parallel axes are blind. A
    step of the focal length alone would leave the narrow, curved valley in which it is determined.

    Returns:
        The bundle, and the derivatives of translations (F, 3) and points (P, 4) by the change.
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


def _influence(system: System, seen: Observations, frames: int) -> Floats:
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
        return np.asarray(np.einsum("mkw,mk->mw", by_pose + common @ inverse[-wanted:] - by_point, residual))
