"""Test of a clip for depth: the residual of a camera that stays in its place, against the noise.

A pan through a lens that distorts, zooms or is read row by row can be solved as a scene of wrong depths with
small errors. So both models, the turning camera and the moving one, have all of these. A homography for each
frame would leave no more than the first, but also explains a camera that moves before a plane. Torr,
"Geometric motion segmentation and model selection", 1998.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Floats
from ...camera.reconstruction import turning_speeds
from ..adjustment.bundle import SIGMA, Bundle, Distortion
from ..adjustment.bundle_adjustment import Adjusted, adjust
from ..adjustment.small_motion import LOSS, LongTracks, general_motion, rotation_only
from ..adjustment.solution import Solution
from ..tracking.degeneracy import MIN_SHARED
from .self_calibration import as_bundle

# Lengths are in pixels of a 1,000-pixel frame.
LONGEST, LONGEST_IN_FRAME = 300, 12
"""As of `self_calibration`, of the tracks that are compared."""
ZOOM_STEP = 0.1
"""Relative change of the focal length from a keyframe to the next that costs as much as an observation
that is off by `LOSS`. Chosen by inspection, and wide: the pictures decide."""
TELLING = 90.0
"""Percentile of the tracks by parallax that is reported: a near thing on a tenth of the picture before a far
background is enough depth."""
WEAK = 0.18
"""Relative uncertainty of depth, over its range, from which the report warns. Pans with 1 % of the width as
parallax have 0.21 to 0.47, handheld clips up to 0.16 (`make bench-solve`)."""


@dataclass(frozen=True)
class DepthEvidence:
    """How much depth a clip shows.

    Lengths are in pixels of a 1,000-pixel frame, of the `TELLING` percentile of the tracks.
    """

    parallax: float
    """Residual of a turning camera beyond that of a moving one, both with a lens that zooms and distorts, and
    a rolling shutter."""
    noise: float
    """Residual of the moving camera."""
    misfit: float
    """Residual of the solve's pinhole."""
    gain: float
    """By how much the geometric robust information criterion of the camera that turns is above that of the
    one that moves, per observation; negative where turning is the better explanation, and depth is not
    observable. Pans have -0.2 to -0.4; a hand that trembles by 5 mm has 0.2, whatever its many frames have of
    noise."""

    @property
    def uncertainty(self) -> float:
        """Error of the solve's depths from its pinhole, as a share of the range of depths."""
        return float(np.sqrt(max(self.misfit**2 - self.noise**2, 0.0))) / max(self.parallax, 1e-9)


def depth_evidence(made: Solution) -> DepthEvidence | None:
    """Return the evidence of depth in the tracks that agree with a solve; None for too few."""
    bundle, seen, posed, kept = as_bundle(made, LONGEST, LONGEST_IN_FRAME)
    if len(kept) < MIN_SHARED:
        return None
    tracks, long_side = made.tracks, max(made.tracks.width, made.tracks.height)
    loss = LOSS * long_side / 1000
    tie = (loss / ZOOM_STEP) ** 2
    focal = float(np.median(made.focal[posed]))
    span = LongTracks(seen, kept, len(posed), loss)
    turns = rotation_only(span, focal).bundle
    speed = turning_speeds(turns.rotation, np.array(tracks.frames)[posed])
    pinhole = Distortion((tracks.width, tracks.height), speed)

    def adjusted(start: Bundle) -> Adjusted:
        return adjust(start, seen, loss, "each", tie)

    turning = adjusted(replace(turns, distortion=pinhole)).bundle
    moving = adjusted(replace(bundle, distortion=pinhole))
    found = _compared((turning, moving.bundle, bundle), span, long_side)
    if found.gain > 0:
        return found
    # The solve may hold distortion for depth, and does not converge from there to the best camera.
    other = adjusted(general_motion(span, turning).bundle)
    best = min(moving, other, key=lambda each: each.cost)
    return _compared((turning, best.bundle, bundle), span, long_side)


def _compared(cameras: tuple[Bundle, Bundle, Bundle], span: LongTracks, long_side: int) -> DepthEvidence:
    """Evidence from residuals of the turning camera, the moving one and the solve, for the same tracks."""
    seen, tracks = span.seen, len(span.tracks)
    errors = [np.nan_to_num(np.linalg.norm(each.residuals(seen), axis=1), nan=long_side) for each in cameras]
    views = np.bincount(seen.point, minlength=tracks)
    turned, moved, solved = (
        1000 / long_side * np.sqrt(np.bincount(seen.point, each**2, tracks) / views) for each in errors
    )
    beyond = np.sqrt(np.maximum(turned**2 - moved**2, 0))
    parallax, noise, misfit = (float(np.percentile(each, TELLING)) for each in (beyond, moved, solved))
    return DepthEvidence(parallax, noise, misfit, _gain(errors[0], errors[1], tracks, span.frames))


def _gain(turned: Floats, moved: Floats, tracks: int, frames: int) -> float:
    """As `DepthEvidence.gain`, of errors (m,) in pixels.

    A track's data have two dimensions a frame; its structure has two in a turning camera, three in a moving
    one; a turning camera has four parameters a frame, a moving one seven, and both the lens's.
    """
    variance = max(float(np.median(moved**2)) / (2 * np.log(2)), 1e-12)
    length = 2 * len(turned) / tracks
    each, all_of = np.log(length), np.log(length * tracks)
    criteria = [
        # The cap of an error is Torr's, twice the dimensions that a structure leaves free, in one picture.
        np.minimum(error**2 / variance, 2 * (2 - structure * 2 / length)).sum()
        + structure * tracks * each
        + (pose * frames + len(SIGMA)) * all_of
        for error, structure, pose in ((turned, 2, 4), (moved, 3, 7))
    ]
    return float(criteria[0] - criteria[1]) / len(turned)
