"""Cameras and points from tracks without an initial pair, for a camera with hardly any motion.

All points begin at infinity, which leaves each camera's turn; then all of them get about the same depth, the
cameras about the same place, and one adjustment finds the rest. Points must be seen in a good part of the
frames. Yu and Gallup, "3D reconstruction from accidental motion", 2014.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...base.arrays import Floats, Ints, Mask
from ..tracking.degeneracy import kabsch, unit_rays
from ..tracking.tracks import Tracks
from .bundle import Bundle, Observations
from .bundle_adjustment import Adjusted, adjust

# Chosen by inspection of solved clips.
MIN_SHARE = 0.4
"""Share of the keyframes in which a track must be seen."""
MIN_VIEWS = 4
"""Keyframes in which a track must be seen, and of a half of them to have a depth from it."""
MIN_COMMON = 30
"""Points with a depth from both halves of a clip, with fewer of which these are not compared."""
LOSS = 1.0
"""Pixels of a 1,000-pixel frame from which on a reprojection error loses weight (Huber)."""


@dataclass(frozen=True)
class LongTracks:
    """Tracks that span a good part of the keyframes."""

    seen: Observations
    tracks: Ints
    """(P,) their numbers."""
    frames: int
    loss: float
    """Pixels."""

    @classmethod
    def of(cls, tracks: Tracks, frames: Ints, kept: Ints) -> LongTracks:
        """Return the tracks (P,) of `kept` in frames (F,)."""
        seen = select_observations(tracks, frames, kept)
        return cls(seen, kept, len(frames), LOSS * max(tracks.width, tracks.height) / 1000)


def long_tracks(tracks: Tracks, keys: list[int]) -> LongTracks:
    """Return the tracks that are seen in enough of the keyframes `keys`, indices of the clip's frames."""
    in_keys = np.isin(tracks.frame_index, keys)
    views = np.bincount(tracks.track[in_keys], minlength=tracks.count)
    least = max(MIN_VIEWS, MIN_SHARE * len(keys))
    kept = np.nonzero(views >= least)[0].astype(np.int32)
    return LongTracks.of(tracks, np.array(keys, np.int32), kept)


def select_observations(tracks: Tracks, frames: Ints, kept: Ints, rows: Mask | bool = True) -> Observations:
    """Return the selected observations (m,) of tracks (P,) in frames (F,), renumbered."""
    place, number = np.full(len(tracks.frames), -1, np.int32), np.full(tracks.count, -1, np.int32)
    place[frames], number[kept] = np.arange(len(frames)), np.arange(len(kept))
    rows = rows & (place[tracks.frame_index] >= 0) & (number[tracks.track] >= 0)
    centre = np.array([tracks.width, tracks.height]) / 2
    return Observations(place[tracks.frame_index[rows]], number[tracks.track[rows]], tracks.xy[rows] - centre)


def rotation_only(span: LongTracks, focal: float) -> Adjusted:
    """Cameras that only turn, and points infinitely far, for a focal length in pixels."""
    seen = span.seen
    rays = unit_rays(seen.xy / focal)
    rotation = _chained(span, rays)
    towards = np.zeros((len(span.tracks), 3))
    np.add.at(towards, seen.point, np.einsum("mji,mj->mi", rotation[seen.frame], rays))
    points = np.column_stack([towards, np.zeros(len(towards))])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    start = Bundle(rotation, np.zeros((span.frames, 3)), points, np.full(span.frames, focal))
    return adjust(start, seen, span.loss)


def general_motion(span: LongTracks, start: Bundle) -> Adjusted:
    """Cameras and points, from cameras that only turn; depths begin alike, and cameras near each other.

    The sign of the depths is not in the pictures of a small motion: the one with more points ahead is taken.
    """
    rng = np.random.default_rng(0)
    points = start.points.copy()
    points[:, 3] = rng.uniform(0.5, 1.5, len(points))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    begun = replace(start, points=points, translation=rng.normal(0, 1e-3, (span.frames, 3)))
    found = adjust(begun, span.seen, span.loss)
    # Positive for directions that the middle camera sees before it.
    ahead = found.bundle.points[:, :3] @ found.bundle.rotation[span.frames // 2, 2]
    if np.median(found.bundle.points[:, 3] * np.sign(ahead)) < 0:
        mirrored = found.bundle.points * [1, 1, 1, -1]
        mirrored_bundle = replace(found.bundle, points=mirrored, translation=-found.bundle.translation)
        found = adjust(mirrored_bundle, span.seen, span.loss)
    return found


def agreement(seen: Observations, bundle: Bundle) -> float | None:
    """Return the rank correlation of the points' inverse depths from both halves of the clip.

    Real depth is found twice; depth from noise and drift of the tracks is not. None with too few points in
    both halves.
    """
    half = (len(bundle.focal) + 1) // 2
    halves = [_inverse_depths(seen, bundle, seen.frame // half == n, MIN_VIEWS) for n in (0, 1)]
    both = np.all(np.isfinite(halves), axis=0)
    if both.sum() < MIN_COMMON:
        return None
    return rank_correlation(*(each[both] for each in halves))


def rank_correlation(a: Floats, b: Floats) -> float:
    """Return Spearman's correlation of two series (n,), without ties."""
    first, second = (np.argsort(np.argsort(each)).astype(np.float64) for each in (a, b))
    return float(np.corrcoef(first, second)[0, 1])


def _chained(span: LongTracks, rays: Floats) -> Floats:
    """(F, 3, 3) rotations, each relative to the frame before by the rays (m, 3) of common points."""
    seen = span.seen
    members = [np.nonzero(seen.frame == frame)[0] for frame in range(span.frames)]
    rotation = [np.eye(3)]
    for before, after in pairwise(members):
        _, i, j = np.intersect1d(seen.point[before], seen.point[after], return_indices=True)
        rotation.append(robust_turn(rays[before[i]], rays[after[j]]) @ rotation[-1])
    return np.array(rotation)


def robust_turn(a: Floats, b: Floats) -> Floats:
    """Return the rotation (3, 3) of unit rays (n, 3) a to b, refined without outliers.

    Outliers are farther off than twice the median.
    """
    kept = np.ones(len(a), bool)
    turn = np.eye(3)
    for _ in range(3 if len(a) else 0):
        turn = kabsch(a[kept], b[kept])
        error = np.linalg.norm(a @ turn.T - b, axis=1)
        kept = error <= 2 * np.median(error) + 1e-12
    return turn


def _inverse_depths(seen: Observations, bundle: Bundle, rows: Mask, least: int) -> Floats:
    """(P,) from some of the observations alone, by linear least squares; NaN where fewer than `least`."""
    frame, point = seen.frame[rows], seen.point[rows]
    ray = seen.xy[rows] / bundle.focal[frame, None]
    pose = np.concatenate([bundle.rotation, bundle.translation[..., None]], axis=2)[frame]
    equations = pose[:, :2] - ray[..., None] * pose[:, 2:]
    count = len(bundle.points)
    normal = np.zeros((count, 4, 4))
    np.add.at(normal, point, np.einsum("mki,mkj->mij", equations, equations))
    flat = np.linalg.eigh(normal)[1][:, :, 0]
    size = np.linalg.norm(flat[:, :3], axis=1)
    sign = np.sign(np.einsum("pi,pi->p", flat[:, :3], bundle.points[:, :3]))
    enough = np.bincount(point, minlength=count) >= least
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(enough, flat[:, 3] / size * sign, np.nan))
