"""A camera that stays in its place: its turns, and its focal length.

Depth must come from elsewhere. Points lie at one distance until then; parallax from the hand is an error.
"""

import numpy as np

from ...base.arrays import Floats, Ints, Mask
from ...base.errors import Remedy, UserError
from ...camera.reconstruction import MEDIAN_DEPTH
from ..adjustment import solution
from ..adjustment.bundle_adjustment import adjust
from ..adjustment.small_motion import LongTracks, robust_turn, rotation_only
from ..adjustment.solution import MIN_POINTS, MIN_VIEWS, Solution
from ..steps import progress
from ..tracking.degeneracy import unit_rays
from ..tracking.tracks import Tracks

# Chosen by inspection of solved clips.
KEYS = 60
"""Frames that are adjusted at once; the others follow from their points."""
IN_FRAME = 40
"""Tracks that are adjusted with each of them, the longest that it sees."""
STILL = 3.0
"""Times the median error of tracks from which on one moves by itself."""
LEAST_TURN = 3.0
"""Degrees of turning below which the focal length is undetermined."""
BOUNDS = (0.4, 2.5)
"""Bounds of a focal length from turning, in long sides of the frame."""
ROUNDS = 3
"""Times that points are found again without what misses them."""


def turned(tracks: Tracks, focal: float, known: float) -> tuple[Solution, float]:
    """Find the turns of a clip's camera.

    Args:
        tracks: Those of the clip.
        focal: Prior of the focal length in pixels.
        known: Its relative standard deviation, 0 to hold it.

    Returns:
        The solve, without translation and with points at `MEDIAN_DEPTH`, and the relative standard deviation
        of its focal length, below `known` if it is the clip's.

    Raises:
        UserError: Too few tracks.
    """
    progress("Finding how the camera turns", 0, 2)
    last = len(tracks.frames) - 1
    keys = np.unique(np.linspace(0, last, min(KEYS, last + 1)).round().astype(np.int32))
    span = _spanning(tracks, keys, _longest(tracks, keys))
    found = rotation_only(span, focal)
    # Moving objects would bias the focal length.
    error = np.linalg.norm(found.bundle.residuals(span.seen), axis=1)
    still = np.bincount(span.seen.point, error, minlength=len(span.tracks)) / np.bincount(span.seen.point)
    span = _spanning(tracks, keys, span.tracks[still < STILL * np.median(still)])
    found = rotation_only(span, focal)
    sigma = known
    if known > 0 and _angle(found.bundle.rotation) > LEAST_TURN:
        free = adjust(found.bundle, span.seen, span.loss, "common")
        low, high = BOUNDS
        share = free.bundle.focal[0] / max(tracks.width, tracks.height)
        if 0 < free.focal_sigma < known and low < share < high:
            found, sigma = free, free.focal_sigma
    progress("Finding how the camera turns", 1, 2)
    made = solution.empty(tracks, float(found.bundle.focal[0]))
    made.translation[:] = 0.0
    made.rotation[keys] = found.bundle.rotation
    _place(made)
    for index in np.setdiff1d(np.arange(last + 1), keys):
        made.rotation[index] = _turn_of(made, int(index))
    _place(made)
    solution.drop_bad(made)
    return made, sigma


def _angle(rotation: Floats) -> float:
    """Degrees of the widest turn from the first of (k, 3, 3) rotations."""
    cosine = (np.einsum("kii->k", rotation @ rotation[0].T) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine.min(), -1, 1))))


def _longest(tracks: Tracks, keys: Ints) -> Ints:
    """Numbers (k,) of the longest tracks of each of some frames `keys`, indices of the clip's frames."""
    views = np.bincount(tracks.track[np.isin(tracks.frame_index, keys)], minlength=tracks.count)
    seen = [tracks.in_frame(int(key))[0] for key in keys]
    longest = [ids[np.argsort(-views[ids], kind="stable")[:IN_FRAME]] for ids in seen]
    kept = np.unique(np.concatenate(longest))
    return np.asarray(kept[views[kept] >= min(MIN_VIEWS, len(keys))], np.int32)


def _spanning(tracks: Tracks, keys: Ints, kept: Ints) -> LongTracks:
    """The observations of tracks `kept` in frames `keys`; UserError for too few."""
    if len(kept) < MIN_POINTS:
        raise UserError(
            f"fewer than {MIN_POINTS} features can be followed for long in this clip; choose another range of"
            " frames",
            Remedy.FRAMES,
        )
    return LongTracks.of(tracks, keys, kept)


def _place(made: Solution) -> None:
    """Points in the mean direction of their rays, of those that do not miss it by twice the median."""
    tracks = made.tracks
    _, rays = made.rays()
    posed = np.isfinite(rays[:, 0])
    rays = np.where(posed[:, None], rays, 0.0)
    weight = posed.astype(np.float64)
    for _ in range(ROUNDS):
        towards = np.zeros((tracks.count, 3))
        np.add.at(towards, tracks.track, weight[:, None] * rays)
        size = np.linalg.norm(towards, axis=1, keepdims=True)
        towards /= np.where(size > 0, size, np.nan)
        off = np.linalg.norm(rays - towards[tracks.track], axis=1)
        weight = 1 / (1 + (off * made.focal[tracks.frame_index] / made.max_error) ** 2)
        weight = np.where(posed, weight, 0.0)
    made.xyz[:] = MEDIAN_DEPTH * towards


def _turn_of(made: Solution, index: int) -> Floats:
    """(3, 3) rotation of a frame from the points that it sees; NaN where they are too few."""
    ids, xy = made.tracks.in_frame(index)
    known: Mask = np.isfinite(made.xyz[ids, 0])
    if np.count_nonzero(known) < MIN_POINTS:
        return np.full((3, 3), np.nan)
    rays = unit_rays((xy[known] - made.centre) / made.focal[index])
    return robust_turn(made.xyz[ids[known]] / MEDIAN_DEPTH, rays)
