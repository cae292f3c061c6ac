"""A solve in progress: poses of frames and points of tracks, and their refinement."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import Floats, Ints, Mask
from ...camera.reconstruction import (
    Image,
    Intrinsics,
    Points,
    Reconstruction,
    rotation_matrix,
    rotation_vector,
)  # fmt: skip
from ..steps import progress
from ..tracking.tracks import Tracks
from .bundle import Bundle, Observations, robust_residuals, weights
from .bundle_adjustment import turns
from .normal_equations import pose_derivatives, summed

# Chosen by inspection of solved clips.
LARGEST_ERROR = 2.0
"""Reprojection error of a kept observation at most, in pixels of a 1,000-pixel frame."""
CLOSE = 0.25
"""Share of `LARGEST_ERROR` at which an observation no longer speaks for a solution."""
MIN_POINTS = 12
"""Points that a frame must see to have a pose, and that a model must have."""
MIN_VIEWS = 3
"""Frames that must see a kept point, and a track that counts as a lasting one."""
MIN_ANGLE = 0.3
"""Degrees between the outermost rays of a kept point that are enough in any clip."""
STEPS = 6
"""Steps of Gauss-Newton, after which poses that begin between keyframes have settled."""


@dataclass
class Solution:
    """The state of the solve over all frames and tracks, world units arbitrary."""

    tracks: Tracks
    focal: Floats
    """(F,) pixels."""
    rotation: Floats
    """(F, 3, 3); NaN where a frame is not registered."""
    translation: Floats
    """(F, 3)"""
    xyz: Floats
    """(count, 3); NaN where a track has no point."""
    used: Mask
    """(m,) observations that take part."""
    largest_error: float = LARGEST_ERROR
    """Reprojection error of a kept observation at most, in pixels of a 1,000-pixel frame."""
    recorded: Floats | None = None
    """(m, 2) places of the observations in the clip, where those of `tracks` are corrected."""

    @property
    def centre(self) -> Floats:
        """(2,) middle of the picture in pixels."""
        return np.array([self.tracks.width, self.tracks.height]) / 2

    @property
    def max_error(self) -> float:
        """Pixels by which an observation may be off."""
        return self.largest_error * max(self.tracks.width, self.tracks.height) / 1000

    def rays(self) -> tuple[Floats, Floats]:
        """Return (F, 3) camera centres and (m, 3) unit world directions of all observations."""
        focal = self.focal[self.tracks.frame_index, None]
        local = np.column_stack([(self.tracks.xy - self.centre) / focal, np.ones(len(focal))])
        turned = np.einsum("mji,mj->mi", self.rotation[self.tracks.frame_index], local)
        centres = -np.einsum("fji,fj->fi", self.rotation, self.translation)
        return centres, turned / np.linalg.norm(turned, axis=1, keepdims=True)

    def errors(self) -> Floats:
        """Return (m,) reprojection errors in pixels; infinite behind a camera, NaN without pose or point."""
        tracks = self.tracks
        return self.errors_of(tracks.frame_index, tracks.track, tracks.xy - self.centre)

    def errors_of(self, frame: Ints, track: Ints, xy: Floats) -> Floats:
        """Return the errors (m,) of tracks in frames, seen at `xy` (m, 2) in pixels from the middle."""
        local = np.einsum("mij,mj->mi", self.rotation[frame], self.xyz[track]) + self.translation[frame]
        with np.errstate(divide="ignore", invalid="ignore"):
            place = local[:, :2] / local[:, 2:] * self.focal[frame, None]
        return np.where(local[:, 2] <= 0, np.inf, np.linalg.norm(place - xy, axis=1))


def empty(tracks: Tracks, focal: float, largest_error: float = LARGEST_ERROR) -> Solution:
    """Return a solution without poses and points."""
    frames = len(tracks.frames)
    return Solution(
        tracks, np.full(frames, focal), np.full((frames, 3, 3), np.nan), np.full((frames, 3), np.nan),
        np.full((tracks.count, 3), np.nan), np.ones(len(tracks.xy), bool), largest_error,
    )  # fmt: skip


def explained(solution: Solution) -> float:
    """Return the used share of the observations of tracks seen by `MIN_VIEWS` registered frames."""
    tracks = solution.tracks
    posed = np.isfinite(solution.translation[tracks.frame_index, 0])
    lasting = np.bincount(tracks.track[posed], minlength=tracks.count) >= MIN_VIEWS
    rows = posed & lasting[tracks.track]
    return float(solution.used[rows].mean()) if rows.any() else 0.0


def score(solution: Solution, keys: list[int]) -> float:
    """Return the share of lasting tracks in the keyframes that is explained, by `closeness`."""
    tracks = solution.tracks
    is_key = np.zeros(len(tracks.frames), bool)
    is_key[keys] = True
    rows = is_key[tracks.frame_index]
    lasting = np.bincount(tracks.track[rows], minlength=tracks.count) >= MIN_VIEWS
    rows &= lasting[tracks.track]
    error = np.where(solution.used, solution.errors(), np.inf)[rows]
    return closeness(error, CLOSE * solution.max_error) if rows.any() else 0.0


def closeness(error: Floats, close: float) -> float:
    """Return the share of errors (m,) below `close` pixels, the less the larger they are; 1 is all, exactly.

    A truncated quadratic: a scene that bends to explain two motions roughly loses to one that explains one
    motion well (MSAC: Torr and Zisserman, "MLESAC", 2000).
    """
    return float(np.fmax(1 - (error / close) ** 2, 0).mean())


def register_frames(solution: Solution) -> None:
    """Poses of the frames between the keyframes from the points they see: robust PnP, then refined."""
    tracks = solution.tracks
    missing = np.nonzero(np.isnan(solution.translation[:, 0]))[0]
    for done, index in enumerate(missing):
        progress("Registering frames", done, len(missing))
        ids, xy = tracks.in_frame(int(index))
        known = np.isfinite(solution.xyz[ids, 0])
        if known.sum() < MIN_POINTS:
            continue
        world, seen = solution.xyz[ids[known]], xy[known]
        lens = np.diag([solution.focal[index], solution.focal[index], 1.0])
        lens[:2, 2] = solution.centre
        cv2.setRNGSeed(0)
        found, turn, shift, inliers = cv2.solvePnPRansac(
            world, seen, lens, None, iterationsCount=200,
            reprojectionError=2 * solution.max_error, flags=cv2.SOLVEPNP_SQPNP,
        )  # fmt: skip
        if not found or inliers is None or len(inliers) < max(MIN_POINTS, 0.3 * known.sum()):
            continue
        rows = inliers.ravel()
        turn, shift = cv2.solvePnPRefineLM(world[rows], seen[rows], lens, None, turn, shift)
        solution.rotation[index] = cv2.Rodrigues(turn)[0]
        solution.translation[index] = shift.ravel()


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


def triangulate(solution: Solution) -> None:
    """Add points of tracks without one, nearest to their rays by least squares."""
    tracks = solution.tracks
    # Observations dropped with another pose or focal length are tried again.
    solution.used = np.ones(len(tracks.xy), bool)
    posed = np.isfinite(solution.translation[:, 0])
    wanted = np.isnan(solution.xyz[:, 0]) & (np.bincount(tracks.track, minlength=tracks.count) >= MIN_VIEWS)
    xyz = nearest_points(solution, wanted[tracks.track] & posed[tracks.frame_index])
    solution.xyz[wanted] = xyz[wanted]


def nearest_points(solution: Solution, rows: Mask, weights: Floats | None = None) -> Floats:
    """Return the points (count, 3) nearest to the rays of the selected observations.

    Least squares; NaN with fewer than `MIN_VIEWS` observations of a track, or parallel rays.

    Args:
        solution: The solve.
        rows: (m,) selected observations.
        weights: (m,).
    """
    tracks = solution.tracks
    track, frame = tracks.track[rows], tracks.frame_index[rows]
    centres, rays = solution.rays()
    away = np.eye(3) - rays[rows][:, :, None] * rays[rows][:, None, :]
    if weights is not None:
        away *= weights[rows, None, None]
    system = np.zeros((tracks.count, 3, 3))
    right = np.zeros((tracks.count, 3))
    np.add.at(system, track, away)
    np.add.at(right, track, np.einsum("mij,mj->mi", away, centres[frame]))
    good = np.bincount(track, minlength=tracks.count) >= MIN_VIEWS
    # Nearly parallel rays make the system singular: no depth.
    total = np.bincount(track, None if weights is None else weights[rows], tracks.count)
    good[good] = np.linalg.eigvalsh(system[good])[:, 0] > 1e-10 * total[good]
    xyz = np.full((tracks.count, 3), np.nan)
    xyz[good] = np.linalg.solve(system[good], right[good][..., None])[..., 0]
    return xyz


def drop_bad(solution: Solution) -> None:
    """Take out observations with a large error, then points with too few left or a poor one on the whole."""
    tracks = solution.tracks
    errors = solution.errors()
    with np.errstate(invalid="ignore"):
        solution.used = errors < solution.max_error
    posed = np.isfinite(solution.translation[tracks.frame_index, 0])
    seen = np.bincount(tracks.track, weights=posed, minlength=tracks.count)
    views = np.bincount(tracks.track[solution.used], minlength=tracks.count)
    # A point that half of its observations contradict is moving, or was tracked wrongly.
    solution.xyz[(views < MIN_VIEWS) | (views < 0.5 * seen)] = np.nan
    solution.used &= np.isfinite(solution.xyz[tracks.track, 0])


def drop_shallow(solution: Solution) -> None:
    """Take out points whose outermost rays enclose too small an angle.

    In a clip where all angles are small, those that are small beside the others.
    """
    tracks = solution.tracks
    centres, _ = solution.rays()
    used = solution.used
    towards = solution.xyz[tracks.track[used]] - centres[tracks.frame_index[used]]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    angle = outermost_angles(towards, tracks.track[used], tracks.count)
    placed = np.isfinite(solution.xyz[:, 0]) & np.isfinite(angle)
    median = float(np.median(angle[placed])) if placed.any() else 0.0
    solution.xyz[~(angle >= min(MIN_ANGLE, median / 3))] = np.nan
    solution.used &= np.isfinite(solution.xyz[tracks.track, 0])


def outermost_angles(rays: Floats, point: Ints, count: int) -> Floats:
    """Return degrees (count,) between the outermost unit rays (m, 3) to points (m,); NaN without a ray."""
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, point, rays)
    np.maximum.at(high, point, rays)
    with np.errstate(invalid="ignore"):
        angle = np.degrees(np.linalg.norm(high - low, axis=1))
    return np.asarray(np.where(np.isfinite(angle), angle, np.nan))


def observed(reconstruction: Reconstruction) -> tuple[Ints, Floats, Floats]:
    """Return point (m,), error (m,) in pixels, NaN behind the camera, and unit ray (m, 3) of observations."""
    points, missed, rays = [], [], []
    for image in reconstruction.images:
        points.append(image.points)
        local = image.to_camera(reconstruction.points.xyz[image.points])
        miss = reconstruction.intrinsics(image).project(local) - image.xy
        missed.append(np.where(local[:, 2] > 0, np.linalg.norm(miss, axis=1), np.nan))
        with np.errstate(invalid="ignore", divide="ignore"):
            rays.append(local / np.linalg.norm(local, axis=1, keepdims=True) @ image.rotation)
    return np.concatenate(points), np.concatenate(missed), np.concatenate(rays)


def mean_errors(point: Ints, missed: Floats, count: int) -> Floats:
    """Return the mean error (count,) of each point, NaN without one, from those of observations (m,)."""
    good = np.isfinite(missed)
    total = np.bincount(point[good], missed[good], count)
    views = np.bincount(point[good], minlength=count)
    return np.where(views > 0, total / np.maximum(views, 1), np.nan)


def kept_points(solution: Solution) -> tuple[Points, Ints, Mask]:
    """Return points with `MIN_VIEWS` used observations, their numbers by track, and the observations (m,)."""
    tracks, used = solution.tracks, solution.used
    views = np.bincount(tracks.track[used], minlength=tracks.count)
    kept = np.isfinite(solution.xyz[:, 0]) & (views >= MIN_VIEWS)
    total = np.bincount(tracks.track[used], weights=solution.errors()[used], minlength=tracks.count)
    points = Points(solution.xyz[kept], tracks.rgb[kept], total[kept] / views[kept])
    return points, (np.cumsum(kept) - 1).astype(np.int32), used & kept[tracks.track]


def collect(solution: Solution) -> Reconstruction:
    """Return the solution as our own type, points numbered anew."""
    tracks, (points, number, used) = solution.tracks, kept_points(solution)
    images = []
    observed = np.nonzero(used)[0]
    first = np.searchsorted(tracks.frame_index[observed], np.arange(1, len(tracks.frames)))
    for index, rows in enumerate(np.split(observed, first)):
        if len(rows) >= MIN_POINTS and np.isfinite(solution.translation[index, 0]):
            ids = number[tracks.track[rows]]
            rotation, translation = solution.rotation[index], solution.translation[index]
            xy = (tracks.xy if solution.recorded is None else solution.recorded)[rows]
            images.append(Image(tracks.frames[index], rotation, translation, xy, ids))
    lenses, camera = np.unique(solution.focal, return_inverse=True)
    width, height = tracks.width, tracks.height
    cameras = tuple(Intrinsics(width, height, f, f, width / 2, height / 2) for f in lenses.tolist())
    place = dict(zip(tracks.frames, camera.tolist(), strict=True))
    images = [replace(image, camera=place[image.frame]) for image in images]
    return Reconstruction(cameras, tuple(images), points)
