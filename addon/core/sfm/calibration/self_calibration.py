"""Focal lengths as far as a clip determines them, and a test of its depth."""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats, Ints
from ..adjustment.bundle import Bundle, Observations, loss_of
from ..adjustment.bundle_adjustment import adjust
from ..adjustment.small_motion import agreement, select_observations
from ..adjustment.solution import MIN_VIEWS, Solution
from ..tracking.tracks import Tracks

# Chosen by inspection of solved clips where no line below gives a measurement.
UNMODELLED = 2.0
"""Ratio of the errors of focal lengths on clips with truth to their covariance, which ignores occlusions and
highlights (`make bench-solve`)."""
MIN_AGREEMENT = 0.6
"""Rank correlation of the depths from the clip's two halves below which there is no depth in it."""
ZOOM_STEP = 0.02
"""Relative change of the focal length from a keyframe to the next that costs as much as all tracks that
miss by a tenth of a pixel."""
ZOOM_STEPS = 200
"""Steps of an adjustment with a focal length a frame, which takes more of them than others."""
LONGEST, LONGEST_IN_FRAME = 1500, 60
"""Number of the clip's longest tracks that take part in an adjustment, and of each frame's beside them."""


def refine_focal_length(made: Solution, start: float, known: float, passes: int = 0) -> float:
    """Refine the focal length by the clip, with `start` as a prior of relative sigma `known`.

    With a path of a few per cent of the depth the focal length is hardly determined; in a walk straight ahead
    it is not determined. The covariance shows it, if whole tracks are its units. Returns the relative sigma
    of the result, which is below `known` / sqrt(2) where the clip's part is larger than the prior's.
    In `passes` after the first the loss follows the errors: the sigma is too small then, for a walk ahead.
    """
    if known == 0:
        return 0.0
    bundle, seen, posed, kept = as_bundle(made)
    loss = made.max_error / 2
    freed = adjust(bundle, seen, loss, "common")
    for _ in range(passes):
        loss = loss_of(np.linalg.norm(freed.bundle.residuals(seen), axis=1))
        freed = adjust(freed.bundle, seen, loss, "common")
    sigma = max(UNMODELLED * freed.focal_sigma, 1e-4)
    weight = known**2 / (known**2 + sigma**2) if np.isfinite(sigma) else 0.0
    wanted = float(np.exp((1 - weight) * np.log(start) + weight * np.log(freed.bundle.focal[0])))
    # On the way to a focal length that the clip does not determine, poses and points have to follow.
    refined = adjust(replace(freed.bundle, focal=np.full(len(posed), wanted)), seen, loss)
    made.focal[:] = wanted
    put_back(made, refined.bundle, posed, kept)
    return float(1 / np.sqrt(1 / known**2 + 1 / sigma**2))


def as_bundle(
    made: Solution, longest: int = LONGEST, in_frame: int = LONGEST_IN_FRAME
) -> tuple[Bundle, Observations, Ints, Ints]:
    """Return an adjustment of the keyframes and their best points, with frames (k,) and tracks (p,).

    Args:
        made: The solve.
        longest: Number of the clip's longest tracks that take part.
        in_frame: Number of each frame's beside them.
    """
    tracks = made.tracks
    posed = np.nonzero(np.isfinite(made.translation[:, 0]))[0].astype(np.int32)
    rows = np.nonzero(made.used)[0]
    views = np.bincount(tracks.track[rows], minlength=tracks.count)
    lasting = np.argsort(-views, kind="stable")[:longest]
    by_frame = rows[np.lexsort(np.stack([-views[tracks.track[rows]], tracks.frame_index[rows]]))]
    frame = tracks.frame_index[by_frame]
    place = np.arange(len(frame)) - np.searchsorted(frame, frame)
    kept = np.union1d(lasting, tracks.track[by_frame[place < in_frame]]).astype(np.int32)
    kept = kept[views[kept] >= MIN_VIEWS]
    points = np.column_stack([made.xyz[kept], np.ones(len(kept))])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return (
        Bundle(made.rotation[posed], made.translation[posed], points, made.focal[posed]),
        select_observations(tracks, posed, kept, made.used), posed, kept,
    )  # fmt: skip


def put_back(made: Solution, bundle: Bundle, posed: Ints, kept: Ints) -> None:
    """Write an adjusted bundle of `as_bundle`, of frames (k,) and tracks (p,), into the solve.

    Other points are dropped, and focal lengths are unchanged.
    """
    made.rotation[posed], made.translation[posed] = bundle.rotation, bundle.translation
    made.xyz[:] = np.nan
    made.xyz[kept] = bundle.world


def halves_disagree(made: Solution) -> bool:
    """Return whether the clip's two halves find different depths.

    Reprojection errors of a pan are as small as those of any other solve.
    """
    bundle, seen, _, _ = as_bundle(made)
    correlation = agreement(seen, bundle)
    return correlation is not None and correlation < MIN_AGREEMENT


# Zoom


def zoom_ratios(tracks: Tracks) -> Floats:
    """Return the focal length (F,) of each frame relative to the middle one, from the picture's growth.

    A walk ahead also makes the picture grow: `refine_zoom` separates both.
    """
    steps = [0.0]
    for index in range(1, len(tracks.frames)):
        a, b = tracks.shared(index - 1, index)
        steps.append(_growth(a, b) if len(a) >= 8 else 0.0)
    path = np.cumsum(steps)
    return np.asarray(np.exp(path - path[len(path) // 2]))


def _growth(a: Floats, b: Floats) -> float:
    """Logarithm of the scale between places (n, 2), by least squares, three times without the worst half."""
    kept = np.ones(len(a), bool)
    scale = 1.0
    for _ in range(3):
        from_a, from_b = a - a[kept].mean(axis=0), b - b[kept].mean(axis=0)
        scale = float((from_a[kept] * from_b[kept]).sum() / max((from_a[kept] ** 2).sum(), 1e-12))
        error = np.linalg.norm(scale * from_a - from_b, axis=1)
        kept = error <= np.median(error)
    return float(np.log(np.clip(scale, 0.5, 2.0)))


def zoomed(tracks: Tracks, ratio: Floats) -> Tracks:
    """Return the tracks as a lens that does not zoom would have seen them; `ratio` is (F,) focal lengths."""
    centre = np.array([tracks.width, tracks.height]) / 2
    return replace(tracks, xy=(tracks.xy - centre) / ratio[tracks.frame_index, None] + centre)


def refine_zoom(made: Solution, tracks: Tracks, ratio: Floats) -> None:
    """Turn a solution of unzoomed tracks into one of `tracks`, with a focal length for each frame.

    The zoom that was removed is `ratio` (F,).
    """
    made.tracks = tracks
    made.focal = made.focal * ratio
    bundle, seen, posed, kept = as_bundle(made)
    tie = 0.01 * len(kept) / ZOOM_STEP**2
    refined = adjust(bundle, seen, made.max_error / 2, "each", tie, steps=ZOOM_STEPS)
    put_back(made, refined.bundle, posed, kept)
    # Between the keyframes the picture's growth is the better guide.
    frames = np.arange(len(tracks.frames))
    correction = np.interp(frames, posed, np.log(refined.bundle.focal / made.focal[posed]))
    made.focal = made.focal * np.exp(correction)
