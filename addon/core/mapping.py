"""Structure from motion for video with pycolmap. Runs in the worker process only: pycolmap can take its
process along.

Keyframes first, with the focal length held (COLMAP's defaults fail on short video); then one free
adjustment whose covariance decides whether a free focal length is believed; then every other frame by its
pose from the same tracks; then all of it adjusted once more.
"""

from __future__ import annotations

from dataclasses import dataclass

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2
import numpy as np
import pycolmap
from numpy.typing import NDArray

from .errors import UserError
from .keyframes import (
    MIN_POINTS,
    adjustment_options,
    free_focal,
    keyframe_features,
    keyframes,
    map_keyframes,
    new_camera,
)
from .parallax import check_parallax
from .reconstruction import Floats, Image, Intrinsics, Ints, Points, Reconstruction, normalise
from .tracks import Progress, Tracks

START_FOCAL = 0.85
"""Long sides of the frame: a phone's main camera."""
MAX_ERROR = 2.0
"""Pixels of reprojection error of a kept observation, for a frame 1,000 pixels long."""
MIN_VIEWS = 3
MIN_ANGLE = 0.3
"""Degrees between the outermost rays of a kept point; less says nothing of its depth."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Mapped:
    """A reconstruction and what is to be said of it."""

    reconstruction: Reconstruction
    focal_sigma: float
    """Relative standard deviation of the focal length, from the covariance of the free adjustment."""
    focal_held: bool
    parallax: float
    """Pixels of a 1,000-pixel frame that no rotation explains."""
    angle: float
    """Median angle in degrees between the outermost rays of a point."""


@dataclass
class _Solution:
    """The state of the solve over all frames and tracks, world units arbitrary."""

    tracks: Tracks
    focal: float
    rotation: Floats
    """(F, 3, 3); NaN where a frame is not registered."""
    translation: Floats
    """(F, 3)"""
    xyz: Floats
    """(count, 3); NaN where a track has no point."""
    used: Mask
    """(m,) observations that take part."""

    @property
    def centre(self) -> Floats:
        return np.array([self.tracks.width, self.tracks.height]) / 2

    @property
    def max_error(self) -> float:
        return MAX_ERROR * max(self.tracks.width, self.tracks.height) / 1000

    def rays(self) -> tuple[Floats, Floats]:
        """(F, 3) camera centres and (m, 3) unit world directions of all observations."""
        local = np.column_stack([(self.tracks.xy - self.centre) / self.focal, np.ones(len(self.tracks.xy))])
        turned = np.einsum("mji,mj->mi", self.rotation[self.tracks.frame_index], local)
        centres = -np.einsum("fji,fj->fi", self.rotation, self.translation)
        return centres, turned / np.linalg.norm(turned, axis=1, keepdims=True)

    def errors(self) -> Floats:
        """(m,) reprojection errors in pixels; infinite behind a camera, NaN without pose or point."""
        frame = self.tracks.frame_index
        local = np.einsum("mij,mj->mi", self.rotation[frame], self.xyz[self.tracks.track])
        local += self.translation[frame]
        with np.errstate(divide="ignore", invalid="ignore"):
            seen = local[:, :2] / local[:, 2:] * self.focal + self.centre
        error = np.linalg.norm(seen - self.tracks.xy, axis=1)
        return np.where(local[:, 2] <= 0, np.inf, error)


def reconstruct(tracks: Tracks, focal: float | None, progress: Progress) -> Mapped:
    """Cameras and points of a clip from its tracks, normalised.

    `focal` in pixels is held if given. Raises UserError with the reason where the clip has no solution.
    """
    pycolmap.logging.minloglevel = 3
    parallax = check_parallax(tracks)
    start = focal or START_FOCAL * max(tracks.width, tracks.height)
    keys = keyframes(tracks)
    features = keyframe_features(tracks, keys)
    model = map_keyframes(tracks, features, start, progress)
    sigma, held = (0.0, True) if focal else free_focal(model, start)
    solution = _from_keyframes(tracks, keys, [ids for ids, _ in features], model)
    _register_frames(solution, progress)
    for step in range(2):
        progress("Adjusting", step, 2)
        _triangulate(solution)
        _drop_bad(solution)
        _adjust(solution)
    _drop_bad(solution)
    angle = _drop_shallow(solution)
    reconstruction = _collect(solution)
    if len(reconstruction.images) < 2 or len(reconstruction.points) < MIN_POINTS:
        raise UserError("too few points could be placed in space; film with more sideways movement")
    return Mapped(normalise(reconstruction), sigma, held, parallax, angle)


def versions() -> dict[str, str]:
    """Of the libraries that a solve depends on."""
    return {"numpy": np.__version__, "opencv": cv2.__version__, "pycolmap": pycolmap.__version__}


def _from_keyframes(
    tracks: Tracks, keys: list[int], features: list[Ints], model: pycolmap.Reconstruction
) -> _Solution:
    """The keyframes' poses and points; `features` are their track numbers in the model's order."""
    frames = len(tracks.frames)
    solution = _Solution(
        tracks, float(model.cameras[1].params[0]), np.full((frames, 3, 3), np.nan),
        np.full((frames, 3), np.nan), np.full((tracks.count, 3), np.nan), np.ones(len(tracks.xy), bool),
    )  # fmt: skip
    support = np.zeros(tracks.count, int)
    for number in model.reg_image_ids():
        image, index = model.images[number], keys[number - 1]
        pose = image.cam_from_world()
        solution.rotation[index] = pose.rotation.matrix()
        solution.translation[index] = pose.translation
        ids = features[number - 1]
        for row, feature in enumerate(image.points2D):
            # Verification can split a track into several points: the best supported one is taken.
            if feature.has_point3D():
                point = model.points3D[feature.point3D_id]
                if point.track.length() > support[ids[row]]:
                    support[ids[row]] = point.track.length()
                    solution.xyz[ids[row]] = point.xyz
    return solution


def _register_frames(solution: _Solution, progress: Progress) -> None:
    """Poses of the frames between the keyframes from the points they see: robust PnP, then refined."""
    tracks = solution.tracks
    lens = np.diag([solution.focal, solution.focal, 1.0])
    lens[:2, 2] = solution.centre
    missing = np.nonzero(np.isnan(solution.translation[:, 0]))[0]
    for done, index in enumerate(missing):
        progress("Registering frames", done, len(missing))
        ids, xy = tracks.in_frame(int(index))
        known = np.isfinite(solution.xyz[ids, 0])
        if known.sum() < MIN_POINTS:
            continue
        world, seen = solution.xyz[ids[known]], xy[known]
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


def _triangulate(solution: _Solution) -> None:
    """Points for tracks that have none: where their rays come closest, by least squares."""
    tracks = solution.tracks
    posed = np.isfinite(solution.translation[:, 0])
    wanted = np.isnan(solution.xyz[:, 0]) & (np.bincount(tracks.track, minlength=tracks.count) >= MIN_VIEWS)
    rows = wanted[tracks.track] & posed[tracks.frame_index] & solution.used
    centres, rays = solution.rays()
    away = np.eye(3) - rays[rows][:, :, None] * rays[rows][:, None, :]
    system = np.zeros((tracks.count, 3, 3))
    right = np.zeros((tracks.count, 3))
    np.add.at(system, tracks.track[rows], away)
    np.add.at(right, tracks.track[rows], np.einsum("mij,mj->mi", away, centres[tracks.frame_index[rows]]))
    views = np.bincount(tracks.track[rows], minlength=tracks.count)
    # Nearly parallel rays make the system singular: no depth.
    good = wanted & (views >= MIN_VIEWS)
    good[good] = np.linalg.eigvalsh(system[good])[:, 0] > 1e-7 * views[good]
    solution.xyz[good] = np.linalg.solve(system[good], right[good][..., None])[..., 0]


def _drop_bad(solution: _Solution) -> None:
    """Take out observations with a large error, then points with too few left or a poor one on the whole."""
    tracks = solution.tracks
    errors = solution.errors()
    with np.errstate(invalid="ignore"):
        solution.used = errors < solution.max_error
    posed = np.isfinite(solution.translation[tracks.frame_index, 0])
    seen = np.bincount(tracks.track, weights=posed, minlength=tracks.count)
    views = np.bincount(tracks.track[solution.used], minlength=tracks.count)
    # A point that half of its own observations contradict moves on its own or was tracked wrongly.
    solution.xyz[(views < MIN_VIEWS) | (views < 0.5 * seen)] = np.nan
    solution.used &= np.isfinite(solution.xyz[tracks.track, 0])


def _drop_shallow(solution: _Solution) -> float:
    """Take out points whose outermost rays enclose too small an angle; median degrees of the others."""
    tracks = solution.tracks
    centres, _ = solution.rays()
    used = solution.used
    towards = solution.xyz[tracks.track[used]] - centres[tracks.frame_index[used]]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    low, high = np.full((tracks.count, 3), np.inf), np.full((tracks.count, 3), -np.inf)
    np.minimum.at(low, tracks.track[used], towards)
    np.maximum.at(high, tracks.track[used], towards)
    with np.errstate(invalid="ignore"):
        angle = np.degrees(np.linalg.norm(high - low, axis=1))
    solution.xyz[~(angle >= MIN_ANGLE)] = np.nan
    solution.used &= np.isfinite(solution.xyz[tracks.track, 0])
    kept = angle[np.isfinite(solution.xyz[:, 0])]
    return float(np.median(kept)) if len(kept) else 0.0


def _adjust(solution: _Solution) -> None:
    """Bundle adjustment of all poses and points, intrinsics held."""
    tracks = solution.tracks
    rows = np.nonzero(solution.used)[0]
    images = tracks.frame_index[rows]
    first = np.searchsorted(images, images)
    place = np.arange(len(rows)) - first
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(new_camera(tracks, solution.focal))
    for index in np.unique(images):
        image = pycolmap.Image(
            name=f"{index:06d}",
            keypoints=tracks.xy[rows[images == index]],
            camera_id=1,
            image_id=int(index) + 1,
        )
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(solution.rotation[index]), solution.translation[index])
        model.add_image_with_trivial_frame(image, pose)
    by_track = np.argsort(tracks.track[rows], kind="stable")
    numbers, starts = np.unique(tracks.track[rows][by_track], return_index=True)
    points = {}
    # pycolmap takes points one by one; there is no call for arrays.
    for number, members in zip(numbers, np.split(by_track, starts[1:]), strict=True):
        track = pycolmap.Track()
        for member in members:
            track.add_element(int(images[member]) + 1, int(place[member]))
        points[number] = model.add_point3D(solution.xyz[number], track)
    pycolmap.bundle_adjustment(model, adjustment_options(refine_focal=False, iterations=25))
    for number, point in points.items():
        solution.xyz[number] = model.points3D[point].xyz
    for index in np.unique(images):
        pose = model.images[int(index) + 1].cam_from_world()
        solution.rotation[index], solution.translation[index] = pose.rotation.matrix(), pose.translation


def _collect(solution: _Solution) -> Reconstruction:
    """The solution as our own type, points numbered anew."""
    tracks, used = solution.tracks, solution.used
    count = tracks.count
    views = np.bincount(tracks.track[used], minlength=count)
    kept = np.isfinite(solution.xyz[:, 0]) & (views >= MIN_VIEWS)
    number = np.cumsum(kept) - 1
    total = np.bincount(tracks.track[used], weights=solution.errors()[used], minlength=count)
    points = Points(solution.xyz[kept], tracks.rgb[kept], total[kept] / views[kept])
    used = used & kept[tracks.track]
    images = []
    for index, frame in enumerate(tracks.frames):
        rows = np.nonzero(used & (tracks.frame_index == index))[0]
        if len(rows) >= MIN_POINTS and np.isfinite(solution.translation[index, 0]):
            ids: Ints = number[tracks.track[rows]].astype(np.int32)
            rotation, translation = solution.rotation[index], solution.translation[index]
            images.append(Image(frame, rotation, translation, tracks.xy[rows], ids))
    width, height = tracks.width, tracks.height
    lens = Intrinsics(width, height, solution.focal, solution.focal, width / 2, height / 2)
    return Reconstruction((lens,), tuple(images), points)
