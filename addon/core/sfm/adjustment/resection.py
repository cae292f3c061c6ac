"""Poses of all frames from points that are known, at once."""

import numpy as np

from ...base.arrays import Floats, Ints
from ...camera.reconstruction import rotation_matrix, rotation_vector
from .bundle import Bundle, Observations, robust_residuals, weights
from .bundle_adjustment import turns
from .normal_equations import pose_derivatives, summed
from .solution import Solution

STEPS = 6
"""Steps of Gauss-Newton, after which poses that begin between keyframes have settled."""


def resected(made: Solution, kept: Ints) -> tuple[Floats, Floats]:
    """Return rotations (F, 3, 3) and translations (F, 3) of all frames from the points of kept tracks.

    Registered frames keep their poses. Others begin between their neighbours, and stay there with too few
    points.

    Args:
        made: A solve of keyframes.
        kept: (p,) tracks.
    """
    tracks = made.tracks
    posed = np.nonzero(np.isfinite(made.translation[:, 0]))[0]
    rotation, translation = _between(made, posed)
    free = np.ones(len(rotation), bool)
    free[posed] = False
    known = np.isfinite(made.xyz[:, 0]) & np.isin(np.arange(tracks.count), kept)
    rows = np.nonzero(free[tracks.frame_index] & known[tracks.track])[0]
    points = np.column_stack([np.nan_to_num(made.xyz), np.ones(tracks.count)])
    seen = Observations(tracks.frame_index[rows], tracks.track[rows], tracks.xy[rows] - made.centre)
    bundle = Bundle(rotation, translation, points, made.focal)
    for _ in range(STEPS):
        bundle = _stepped(bundle, seen, made.max_error / 2)
    return bundle.rotation, bundle.translation


def _stepped(bundle: Bundle, seen: Observations, loss: float) -> Bundle:
    """The poses after a step of Gauss and Newton's method, with Huber's loss from `loss` pixels."""
    residuals, local = robust_residuals(bundle, seen)
    weight = weights(residuals, loss)[0]
    derived = pose_derivatives(bundle, seen, local)[0][..., :6]
    heavy = derived * weight[:, None, None]
    frames = len(bundle.focal)
    normal = summed(np.einsum("mki,mkj->mij", heavy, derived), seen.frame, frames)
    right = summed(np.einsum("mki,mk->mi", heavy, np.nan_to_num(residuals)), seen.frame, frames)
    # Frames that see too little stay where they are.
    normal += np.eye(6) * (1e-6 * np.einsum("fii->f", normal) + 1e-6)[:, None, None]
    step = -np.linalg.solve(normal, right[..., None])[..., 0]
    turn = turns(step[:, :3])
    return Bundle(
        turn @ bundle.rotation, np.einsum("fij,fj->fi", turn, bundle.translation) + step[:, 3:],
        bundle.points, bundle.focal,
    )  # fmt: skip


def _between(made: Solution, posed: np.ndarray[tuple[int], np.dtype[np.intp]]) -> tuple[Floats, Floats]:
    """Poses of all frames, those without one on the straight way between their neighbours'."""
    frames = np.arange(len(made.translation))
    after = np.clip(np.searchsorted(posed, frames), 1, len(posed) - 1)
    first, last = posed[after - 1], posed[after]
    share = np.clip((frames - first) / (last - first), 0, 1)
    rotation = np.array(
        [
            rotation_matrix(s * rotation_vector(made.rotation[b] @ made.rotation[a].T)) @ made.rotation[a]
            for a, b, s in zip(first, last, share, strict=True)
        ]
    )
    centres = -np.einsum("fji,fj->fi", made.rotation, made.translation)
    centre = centres[first] + share[:, None] * (centres[last] - centres[first])
    return rotation, -np.einsum("fij,fj->fi", rotation, centre)
