"""Points of a clip whose cameras are known: another program's poses and lenses, which are held.

Pairs of frames first show whether the cameras belong to the clip: the ray of a pixel of one frame, from
infinity to the camera, is a line in the other frame, on which the track must lie. This needs no depth, so
other frame numbers and other focal lengths are tested quickly. Then tracks are triangulated with decreasing
weights for disagreeing observations; the remaining disagreement is the reprojection error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arrays import Floats, Ints, Mask
from ...base.counting import counted
from ...base.errors import Remedy, UserError
from ...camera.reconstruction import Image, Points, Reconstruction, seen_by
from ...readers.matching import if_every
from ..adjustment import solution
from ..adjustment.solution import LARGEST_ERROR, MIN_POINTS, MIN_VIEWS, Solution
from ..steps import progress
from ..tracking.tracks import Tracks

# Pixels are those of a 1,000-pixel frame.
PAIRS = 24
"""Pairs of frames that are looked at. Chosen by inspection."""
MOST_SHARED = 200
"""Tracks of a pair that are looked at, for time."""
LASTING = 0.5
"""Share of a frame's tracks that the other frame of a pair has, too, at least. Chosen by inspection."""
GOOD = 0.3
"""Pixels by which tracks miss in the median below which no other frame numbers are tried. Our own solves'
poses miss by 0.06 to 0.13 (of bars, walk and stroller), a phone-like walk's (real data, room) by 0.8; one
frame too late by 1.0 to 16, with a focal length of 10 % more by 0.3 to 4."""
MISFIT = 4.0
"""Pixels by which tracks miss in the median above which poses are of something else: those of the same
clips backwards, or with y and z the other way round, miss by 5 to 130; a network's that is off by 0.2
degrees misses by 3."""
UNEXPLAINED = 0.25
"""Share of the tracks' motion left by poses, above which they belong to another clip. Chosen by inspection:
right ones leave 1 %."""
BETTER = 0.5
"""Largest ratio of residuals with which other frame numbers, or another focal length, are reported. Chosen by
inspection."""
OVERLAP = 0.5
"""Share of the pairs, at least, that other frame numbers have poses for. Chosen by inspection."""
LARGEST_OFFSET = 2000
"""Frames of the farthest that is tried, for time."""
SLACK = 3.0
"""Times what tracks miss in the median, a point's observation may be off, where that is more than
`solution.LARGEST_ERROR`: poses of networks and of phones miss by more than a solve does. Chosen by
inspection."""
CELLS = (24, 16)
"""Across and down a picture; one point of each is enough for focus and range. Chosen by inspection."""
MOST_POINTS = 20_000
"""Most points of an unobserved cloud. Chosen by inspection."""


class NoDepthError(UserError):
    """The cameras may be right, but the clip has no parallax."""


FOCALS = tuple((1.03 ** np.arange(-24, 25)).tolist())
"""Factors of the focal length that are tried: half to twice."""
ROUNDS = 6
"""Rounds of reweighting. Chosen by inspection."""
NEAREST = 0.01
"""Least depth of an observation for its weight, relative to the median depth."""
FAR = 1e4
"""Pixels of error that stand for infinity."""


@dataclass(frozen=True)
class Known:
    """A clip's points before known cameras."""

    reconstruction: Reconstruction
    """Every frame of the clip that has a pose, in the unit and the world of the poses."""
    miss: float
    """Pixels of a 1,000-pixel frame by which tracks miss in pairs of frames, median."""
    explained: float
    """Share of the observations of lasting tracks that agree with a point that stands still."""


def triangulate(cameras: Reconstruction, tracks: Tracks) -> Known:
    """Find the points of a clip's tracks with known cameras.

    The cameras' own points are ignored.

    Args:
        cameras: Cameras of the clip's frames, and maybe of others, so that a shift of frame numbers is found.
        tracks: Tracks of the clip.

    Raises:
        UserError: The cameras belong to another clip; the message names frame numbers or a focal length that
            would fit.
        NoDepthError: There is no parallax.
    """
    progress("Comparing cameras", 0, 1)
    posed = np.isin(tracks.frames, cameras.frames)
    every = if_every(len(cameras.images), tracks.frames)
    # Frames without a pose are left out, unless all are: then frames are numbered otherwise.
    tracks = _of_frames(tracks, posed) if posed.sum() > 1 else tracks
    miss = _fits(_Epipolar(cameras, tracks, _pairs(tracks)), every)
    made = _rectified(cameras, tracks, miss)
    for step in range(2):
        progress("Adjusting", step, 2)
        _place(made)
        solution.drop_bad(made)
    solution.drop_shallow(made)
    explained = solution.explained(made)
    found = _collected(cameras, tracks, made)
    if len(found.points) < MIN_POINTS:
        raise NoDepthError(
            f"of {counted(tracks.count, 'tracked feature')} only {len(found.points)} could be placed in 3D"
            " with these cameras: they hardly move, or only turn, so the clip shows no depth"
        )
    return Known(found, miss, explained)


def _of_frames(tracks: Tracks, kept: Mask) -> Tracks:
    """The observations in some frames (F,)."""
    rows = kept[tracks.frame_index]
    number = (np.cumsum(kept) - 1).astype(np.int32)
    some = tracks.only(rows)
    frames = tuple(np.array(tracks.frames)[kept].tolist())
    return replace(some, frames=frames, frame_index=number[some.frame_index])


@dataclass(frozen=True)
class _Pair:
    """Tracks that two frames share."""

    i: int
    j: int
    """Indices into the tracks' frames."""
    a: Floats
    b: Floats
    """(n, 2) places in pixels of the source frames."""


def _pairs(tracks: Tracks) -> list[_Pair]:
    """Pairs over the whole clip, each as far apart as enough tracks last; UserError where there are none."""
    count, found = len(tracks.frames), []
    for i in np.unique(np.linspace(0, count - 2, min(PAIRS, count - 1)).round().astype(int)).tolist():
        here = len(tracks.in_frame(i)[0])
        best = None
        for gap in 2 ** np.arange(8):
            if i + gap >= count:
                break
            a, b = tracks.shared(i, i + int(gap))
            if len(a) < max(12, LASTING * here):
                break
            best = _Pair(i, i + int(gap), a, b)
        if best is not None:
            step = -(-len(best.a) // MOST_SHARED)
            found.append(replace(best, a=best.a[::step], b=best.b[::step]))
    if not found:
        raise UserError(
            "no features can be followed from frame to frame, so these cameras cannot be checked against"
            " the clip"
        )
    return found


@dataclass(frozen=True)
class _Epipolar:
    """By how much tracks miss, with the frames or the focal lengths that poses may be of."""

    cameras: Reconstruction
    tracks: Tracks
    pairs: list[_Pair]

    @cached_property
    def _images(self) -> dict[int, Image]:
        return {image.frame: image for image in self.cameras.images}

    def miss(self, offset: int = 0, focal: float = 1.0) -> float:
        """Median residual (px of 1,000) with frame f at the pose of f + offset; NaN for too few pairs."""
        found = []
        for pair in self.pairs:
            one, other = (self._images.get(self.tracks.frames[index] + offset) for index in (pair.i, pair.j))
            if one is not None and other is not None:
                found.append(self._distances(one, other, pair, focal))
        if len(found) < OVERLAP * len(self.pairs):
            return float("nan")
        return float(np.median(np.concatenate(found))) * (1000 / max(self.tracks.width, self.tracks.height))

    @property
    def moved(self) -> float:
        """Median motion of tracks between the frames of a pair, in pixels of a 1,000-pixel frame."""
        moved = np.concatenate([np.linalg.norm(pair.a - pair.b, axis=1) for pair in self.pairs])
        return float(np.median(moved)) * 1000 / max(self.tracks.width, self.tracks.height)

    def _distances(self, one: Image, other: Image, pair: _Pair, focal: float) -> Floats:
        """(n,) pixels in the second frame between a track and all places where its ray may be seen."""
        rays, seen = (self._rays(image, xy, focal) for image, xy in ((one, pair.a), (other, pair.b)))
        turn = other.rotation @ one.rotation.T
        shift = other.translation - turn @ one.translation
        far = np.column_stack([rays, np.ones(len(rays))]) @ turn.T
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            start = far[:, :2] / far[:, 2:]
            # Where the point goes as it comes nearer; its ray ends in the first camera, at the epipole.
            along = (shift[:2] - start * shift[2]) / far[:, 2:]
            length = np.linalg.norm(along, axis=1)
            along = along / np.where(length > 0, length, 1)[:, None]
            end = np.full(len(rays), np.inf)
            if shift[2] > 0:
                end = np.linalg.norm(shift[:2] / shift[2] - start, axis=1)
            away = seen - start
            reach = np.clip((away * along).sum(axis=1), 0, end)
            distance = np.linalg.norm(away - reach[:, None] * along, axis=1)
        pixels = focal * float(self.cameras.intrinsics(other).focal.mean())
        # A point behind the second camera anywhere on its ray is missed completely.
        return np.where(np.isfinite(distance) & (far[:, 2] > 0), distance * pixels, np.inf)

    def _rays(self, image: Image, xy: Floats, focal: float) -> Floats:
        lens = self.cameras.intrinsics(image)
        return lens.undistort((xy - lens.principal_point) / (focal * lens.focal))


def _fits(epipolar: _Epipolar, every: str) -> float:
    """The residual of tracks; UserError, which ends in `every` (`if_every`), for another clip's cameras."""
    miss = epipolar.miss()
    if miss <= GOOD:
        return miss
    clip, posed = np.array(epipolar.tracks.frames), epipolar.cameras.frames
    first, last = (
        max(-LARGEST_OFFSET, min(at, LARGEST_OFFSET))
        for at in (int(posed[0] - clip[-1]), int(posed[-1] - clip[0]))
    )
    allowed = min(MISFIT, max(UNEXPLAINED * epipolar.moved, GOOD))
    by_offset, offset = _least(lambda each: epipolar.miss(offset=int(each)), range(first, last + 1))
    by_focal, focal = _least(lambda each: epipolar.miss(focal=each), FOCALS)
    found = min(by_offset, by_focal)
    if found <= min(allowed, BETTER * miss if np.isfinite(miss) else allowed):
        then = f"the error would then be {found:.1f} pixels in 1000"
        then += f", instead of {miss:.1f}" if np.isfinite(miss) else ""
        if by_focal < by_offset:
            raise UserError(
                f"these cameras have another lens than the clip: they fit with {focal:.2f} times the focal"
                f" length ({then})"
            )
        when = f"{counted(abs(int(offset)), 'frame')} {'later' if offset > 0 else 'earlier'}"
        raise UserError(
            "these cameras belong to other frames of the clip: they fit if each frame uses the camera"
            f" {when} (offset {int(offset):+d}: {then})"
        )
    if not miss <= allowed:
        missed = f"the error is {miss:.0f} pixels in 1000, and"
        if not np.isfinite(miss):
            missed = "hardly any of its frames has one of them, and"
        raise UserError(
            f"these cameras do not belong to this clip: {missed} no other frame offset or focal length"
            f" explains it; choose the clip they were made from{every}",
            *((Remedy.STEP,) if every else ()),
        )
    return miss


def _least(miss: Callable[[float], float], tried: Sequence[float]) -> tuple[float, float]:
    """The least residual, and the tried value that has it."""
    found = [(value, each) for each in tried if np.isfinite(value := miss(each))]
    return min(found, default=(float("inf"), 0.0))


def _rectified(cameras: Reconstruction, tracks: Tracks, miss: float) -> Solution:
    """The tracks as pinholes with the principal point in the middle would see them, and the poses."""
    at = {image.frame: image for image in cameras.images}
    images = [at[frame] for frame in tracks.frames]
    centre = np.array([tracks.width, tracks.height]) / 2
    xy, focal = tracks.xy.copy(), np.empty(len(images))
    for index, image in enumerate(images):
        lens = cameras.intrinsics(image)
        low, high = np.searchsorted(tracks.frame_index, [index, index + 1])
        focal[index] = lens.fx
        xy[low:high] = lens.undistort((xy[low:high] - lens.principal_point) / lens.focal) * lens.fx + centre
    made = solution.empty(replace(tracks, xy=xy), 1.0, max(LARGEST_ERROR, SLACK * miss))
    made.focal = focal
    made.rotation = np.array([image.rotation for image in images])
    made.translation = np.array([image.translation for image in images])
    return made


def _place(made: Solution) -> None:
    """Points where rays come closest in pixels; those that pass far away count little (Cauchy's weights)."""
    tracks = made.tracks
    made.xyz[:] = np.nan
    made.used = np.isfinite(tracks.xy).all(axis=1)
    views = np.bincount(tracks.track[made.used], minlength=tracks.count)
    wanted = (views >= MIN_VIEWS)[tracks.track] & made.used
    weights = np.ones(len(tracks.xy))
    scale = made.max_error / 2
    for _ in range(ROUNDS):
        made.xyz = solution.nearest_points(made, wanted, weights)
        local = np.einsum("mij,mj->mi", made.rotation[tracks.frame_index], made.xyz[tracks.track])
        depth = local[:, 2] + made.translation[tracks.frame_index, 2]
        if not np.any(depth > 0):
            return
        nearest = NEAREST * np.median(depth[depth > 0])
        error = np.nan_to_num(made.errors(), nan=FAR, posinf=FAR)
        # A miss in pixels is one in space over the depth.
        weights = 1 / (
            np.maximum(np.nan_to_num(depth), nearest) ** 2 * (1 + (np.minimum(error, FAR) / scale) ** 2)
        )


def _collected(cameras: Reconstruction, tracks: Tracks, made: Solution) -> Reconstruction:
    """The points with their observations as the clip has them, before all cameras of its frames."""
    points, number, used = solution.kept_points(made)
    at = {image.frame: image for image in cameras.images}
    images = []
    for index, frame in enumerate(tracks.frames):
        rows = np.flatnonzero(used & (tracks.frame_index == index))
        images.append(replace(at[frame], xy=tracks.xy[rows], points=number[tracks.track[rows]]))
    return Reconstruction(cameras.cameras, tuple(images), points)


def thinned(cloud: Reconstruction) -> Reconstruction:
    """Return a cloud computed from depth with few points, enough for focus and range.

    Each point has a frame that shows it. One observed point is kept in each of a frame's `CELLS`; unobserved
    points are projected into all frames, without a test for occlusion.
    """
    points, images = cloud.points, cloud.images
    if any(len(image.points) for image in images):
        images = tuple(_thinned(image, cloud) for image in images)
        kept = np.unique(np.concatenate([image.points for image in images]))
    else:
        kept = np.unique(np.linspace(0, len(points) - 1, min(len(points), MOST_POINTS)).round().astype(int))
        images = tuple(_projected(image, cloud, kept.astype(np.int32)) for image in images)
    number = np.zeros(len(points), np.int32)
    number[kept] = np.arange(len(kept))
    images = tuple(replace(image, points=number[image.points]) for image in images)
    return Reconstruction(
        cloud.cameras, images, Points(points.xyz[kept], points.rgb[kept], points.error[kept])
    )


def _thinned(image: Image, cloud: Reconstruction) -> Image:
    lens = cloud.intrinsics(image)
    cell = np.floor(image.xy / [lens.width, lens.height] * CELLS).astype(int)
    _, first = np.unique(cell, axis=0, return_index=True)
    first.sort()
    return replace(image, xy=image.xy[first], points=image.points[first])


def _projected(image: Image, cloud: Reconstruction, rows: Ints) -> Image:
    local, ahead = seen_by(image, cloud, rows)
    lens = cloud.intrinsics(image)
    place = lens.project(local)
    with np.errstate(invalid="ignore"):
        ahead &= np.all((place >= 0) & (place < [lens.width, lens.height]), axis=1)
    return replace(image, xy=place[ahead], points=rows[ahead])
