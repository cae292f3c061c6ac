"""Structure from motion for video. Runs in the worker process only: pycolmap can take its process along.

Keyframes first, with the focal length held (COLMAP's defaults fail on short video), by pairs of pictures
with parallax or, where that explains too little, all at once; then the focal length, as far as the clip
determines it; then every other frame by its pose from the same tracks; then all of it adjusted once more. A
zoom is taken out of the tracks before, and given back to the frames after the keyframes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import cv2
import numpy as np
import pycolmap

from ..base.errors import Remedy, UserError
from ..camera.reconstruction import Floats, Ints, Reconstruction, normalise
from . import self_calibration, small_motion, solution
from .degeneracy import check_motion, only_turns
from .keyframes import adjust, keyframe_features, keyframes, map_keyframes
from .solution import MIN_POINTS, Solution
from .stabilised import refuse_shifted
from .tracks import Progress, Tracks

START_FOCAL = 0.85
"""Long sides of the frame: a phone's main camera."""
MIN_PARALLAX = 1.0
"""Pixels of a 1,000-pixel frame that no rotation explains; less is a trembling hand, or only turns."""
DOUBTFUL = 10.0
"""Pixels of a 1,000-pixel frame; with less parallax it is asked whether turning alone explains the clip."""
EXPLAINED = 0.8
"""Share of the observations that a good solve explains; less, and something moves by itself or went wrong."""
LEAST_EXPLAINED = 0.565
"""Share below which a solve is none. Between the clips of `benchmarks.solving`, where a thing of 30 % of the
picture that goes its own way leaves 0.58 to 0.63 and the solve is right, and 0.47 to 0.55 of shifted ones."""
LONGER = 1.3
"""Times the first focal length: the second one to begin with."""
GROWTH = 1.05
"""Ratio of the picture's scales over a clip below which it is not asked whether the lens zooms, and"""
ZOOMS = 1.1
"""by how much a zoom that nobody announced must explain it better."""


@dataclass(frozen=True)
class Lens:
    """What is known of the focal length before the clip has been looked at."""

    focal: float | None = None
    """Pixels."""
    sigma: float = 0.0
    """Relative standard deviation of `focal`; 0 holds it."""
    zooms: bool = False
    """It changes over the clip."""

    @property
    def free(self) -> bool:
        """No focal length was given that is to be held."""
        return self.focal is None or self.sigma > 0


@dataclass(frozen=True)
class Mapped:
    """A reconstruction and what is to be said of it."""

    reconstruction: Reconstruction
    method: str
    """"pairs" or "at once"."""
    focal_sigma: float
    """Relative standard deviation of the focal length, what was known before included."""
    focal_from_clip: bool
    """The clip says more of the focal length than was known before."""
    parallax: float
    """Pixels of a 1,000-pixel frame that no rotation explains."""
    angle: float
    """Median angle in degrees between the outermost rays of a point."""
    explained: float
    """Share of the observations of lasting tracks that agree with a point that stands still."""
    moving: Ints
    """Numbers of lasting tracks that do not."""
    zooms: bool
    """Solved with a focal length a frame."""


def reconstruct(tracks: Tracks, lens: Lens, progress: Progress) -> Mapped:
    """Cameras and points of a clip from its tracks, normalised.

    Raises UserError with the reason where the clip has no solution.
    """
    parallax = check_motion(tracks)
    keys = keyframes(tracks)
    start = lens.focal or START_FOCAL * max(tracks.width, tracks.height)
    found, ratio = _zoom_or_not(tracks, keys, start, lens, parallax, progress)
    best = found.solution
    refuse_shifted(best, keys)
    if ratio is not None:
        self_calibration.refine_zoom(best, tracks, ratio)
    solution.register_frames(best, progress)
    for step in range(2):
        progress("Adjusting", step, 2)
        solution.triangulate(best)
        solution.drop_bad(best)
        adjust(best)
    solution.drop_bad(best)
    angle = solution.drop_shallow(best)
    explained, moving = solution.explained(best)
    if explained < LEAST_EXPLAINED:
        raise UserError(
            f"only {100 * explained:.0f} % of what was tracked agrees with one scene that stands still: too"
            " much moves on its own, or the pictures were shifted or warped after they were taken; choose"
            " another range of frames, or solve the clip as it was filmed",
            Remedy.FRAMES,
        )
    reconstruction = solution.collect(best)
    if len(reconstruction.images) < 2 or len(reconstruction.points) < MIN_POINTS:
        raise UserError("too few points could be placed in space; film with more sideways movement")
    return Mapped(
        normalise(reconstruction), found.method, found.focal_sigma, found.focal_from_clip, parallax, angle,
        explained, moving, ratio is not None,
    )  # fmt: skip


def versions() -> dict[str, str]:
    """Of the libraries that a solve depends on."""
    return {"numpy": np.__version__, "opencv": cv2.__version__, "pycolmap": pycolmap.__version__}


@dataclass(frozen=True)
class _Found:
    """What one way made of the keyframes."""

    solution: Solution
    method: str
    focal_sigma: float
    focal_from_clip: bool
    explained: float
    """Share of the keyframes registered times the share of their observations that take part."""
    score: float
    """Of 1: how much of what the keyframes see is explained, and how closely."""


def _zoom_or_not(
    tracks: Tracks, keys: list[int], focal: float, lens: Lens, parallax: float, progress: Progress
) -> tuple[_Found, Floats | None]:
    """What comes of the keyframes, and (F,) by how much the lens zooms if it does.

    A focal length that changes unannounced leaves much unexplained; one that was given does not change.
    """
    found = None if lens.zooms else _keyframe_solution(tracks, keys, focal, lens, parallax, progress)
    if found is not None and (not lens.free or found.explained >= EXPLAINED):
        return found, None
    ratio = self_calibration.zoom_ratios(tracks)
    if found is not None and ratio.max() < GROWTH * ratio.min():
        return found, None
    other = _keyframe_solution(self_calibration.zoomed(tracks, ratio), keys, focal, lens, parallax, progress)
    if found is not None and other.score < ZOOMS * found.score:
        return found, None
    return other, ratio


def _keyframe_solution(
    tracks: Tracks, keys: list[int], focal: float, lens: Lens, parallax: float, progress: Progress
) -> _Found:
    """The best of what the ways make of the keyframes; UserError where none leads anywhere."""
    found: list[_Found] = []

    def keep(made: Solution | None, method: str) -> None:
        if made is not None:
            progress("Settling the focal length", 0, 1)
            found.append(_judged(made, keys, lens, focal, method))

    if parallax >= MIN_PARALLAX:
        keep(_by_pairs(tracks, keys, focal, progress), "pairs")
        if found and found[0].explained < EXPLAINED:
            # It may have fastened upon what moves: what it explains is taken away, and the rest asked.
            keep(_by_pairs(_without(tracks, found[0].solution), keys, focal, progress, tracks), "pairs")
        if found and lens.free and max(found, key=lambda each: each.score).explained < EXPLAINED:
            # Or it began with too short a lens and holds a flat background for all there is.
            keep(_by_pairs(tracks, keys, LONGER * focal, progress), "pairs")
    if not found or max(each.explained for each in found) < EXPLAINED:
        keep(_at_once(tracks, keys, focal), "at once")
    best = max(found, key=lambda each: each.score, default=None)
    if parallax < DOUBTFUL and (best is None or self_calibration.turning_explains(best.solution)):
        raise only_turns(parallax)
    if best is None:
        raise UserError(
            "no camera path explains this clip: too little parallax, or too much moves on its own;"
            " choose another range of frames, or film with more sideways movement",
            Remedy.FRAMES,
        )
    return best


def _judged(made: Solution, keys: list[int], lens: Lens, start: float, method: str) -> _Found:
    """A solution of the keyframes with its focal length refined, and how much of the clip it explains."""
    solution.triangulate(made)
    solution.drop_bad(made)
    known = lens.sigma if lens.focal else self_calibration.GUESS_SIGMA
    sigma, from_clip = self_calibration.refine_focal_length(made, start, known)
    solution.triangulate(made)
    solution.drop_bad(made)
    share, _ = solution.explained(made)
    posed = float(np.isfinite(made.translation[keys, 0]).mean())
    return _Found(made, method, sigma, from_clip, share * posed, solution.score(made, keys))


def _by_pairs(
    tracks: Tracks, keys: list[int], focal: float, progress: Progress, whole: Tracks | None = None
) -> Solution | None:
    """COLMAP's incremental mapping; the solution is of the tracks `whole` if these are but a part of them."""
    features = keyframe_features(tracks, keys)
    model = map_keyframes(tracks, features, focal, progress)
    if model is None:
        return None
    made = solution.empty(whole or tracks, focal)
    support = np.zeros(tracks.count, int)
    for number in model.reg_image_ids():
        image, index = model.images[number], keys[number - 1]
        pose = image.cam_from_world()
        made.rotation[index], made.translation[index] = pose.rotation.matrix(), pose.translation
        ids = features[number - 1][0]
        for row, feature in enumerate(image.points2D):
            # Verification can split a track into several points: the best supported one is taken.
            if feature.has_point3D():
                point = model.points3D[feature.point3D_id]
                if point.track.length() > support[ids[row]]:
                    support[ids[row]] = point.track.length()
                    made.xyz[ids[row]] = point.xyz
    return made


def _without(tracks: Tracks, made: Solution) -> Tracks:
    """The tracks that a solution has no point for; their numbers stay."""
    rows = np.isnan(made.xyz[tracks.track, 0])
    return replace(tracks, frame_index=tracks.frame_index[rows], track=tracks.track[rows], xy=tracks.xy[rows])


def _at_once(tracks: Tracks, keys: list[int], focal: float) -> Solution | None:
    """One adjustment of all keyframes from nothing; None where too few tracks span them."""
    span = small_motion.long_tracks(tracks, keys)
    if len(span.tracks) < 4 * MIN_POINTS:
        return None
    placed = small_motion.general_motion(span, small_motion.rotation_only(span, focal).bundle)
    made = solution.empty(tracks, focal)
    made.rotation[keys], made.translation[keys] = placed.bundle.rotation, placed.bundle.translation
    made.xyz[span.tracks] = placed.bundle.world
    return made
