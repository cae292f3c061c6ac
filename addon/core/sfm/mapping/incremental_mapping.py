"""Structure from motion for video.

Runs in the worker process only: pycolmap can take its process along.

Keyframes first, with the focal length held (COLMAP's defaults fail on short video): by pairs of pictures
with parallax or, where that explains too little, all at once. Then the focal length, as far as the clip
determines it; then every other frame by its pose from the same tracks; then all of it
adjusted once more. A zoom is taken out of the tracks before, and given back to the frames after the
keyframes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

# The order matters: imported after pycolmap, OpenCV's PNG writer frees memory twice.
import numpy as np

from ...base.arrays import Floats
from ...base.errors import Remedy, UserError
from ...camera.reconstruction import Reconstruction, normalise
from ..adjustment import small_motion, solution
from ..adjustment.solution import MIN_POINTS, Solution
from ..calibration import self_calibration
from ..calibration.lens import Lens, find_lens, report_of
from ..calibration.rotation import turned
from ..calibration.stabilised import refuse_shifted
from ..calibration.stationary import WEAK, DepthEvidence, depth_evidence
from ..report import EXPLAINED, LEFT_OUT, STAYS, Figures, Solved
from ..steps import Record, progress
from ..tracking.degeneracy import StaysError, check_motion, only_turns
from ..tracking.tracks import Tracks
from .keyframes import START_FOCAL, adjust, keyframe_features, keyframes, map_keyframes

START_SIGMA = 0.2
"""Relative standard deviation of a focal length that nobody gave. Chosen by inspection."""


@dataclass(frozen=True)
class FocalPrior:
    """Prior knowledge of the focal length."""

    focal: float | None = None
    """Pixels."""
    sigma: float = START_SIGMA
    """Relative standard deviation of the focal length to begin with; 0 holds it."""
    zooms: bool = False
    """True if the focal length changes over the clip."""
    source: str = "guess"
    """Where it is from, as `Report.focal_from`."""

    def start(self, tracks: Tracks) -> float:
        """Return pixels of focal length to begin with."""
        return self.focal or START_FOCAL * max(tracks.width, tracks.height)


# Chosen by inspection where no line below gives a measurement; checked by the solves of `make bench-solve`.
LONGER_FOCAL = 1.3
"""Factor of the first focal length that gives a second one to begin with."""
MIN_PARALLAX = 1.0
"""Pixels of a 1,000-pixel frame that no rotation explains; with less, pairs of pictures are not tried: it
is a trembling hand, or only turns."""
PASSES = 2
"""Passes that refine the focal length of the best start without a lens. Those of oncoming and walk are off by
11.8 and 7.3 % with none, by 4.4 and 0.6 with two."""
TOLD_PARALLAX = 0.3
"""Pixels of a 1,000-pixel frame that no rotation explains, below which depth from elsewhere is better. A
still camera can reach it."""
DOUBTFUL_PARALLAX = 10.0
"""Pixels of a 1,000-pixel frame that no rotation explains; with less, the clip's halves are to find the
same depths."""
MIN_FOLLOWED = 0.25
"""Share of the observations that pairs of pictures must explain for other pairs to be tried: they bring 0.46
to 0.65 in a busy restaurant, and nothing to a walk ahead with 0.22 and to nearly static cameras."""
MIN_EXPLAINED = 0.565
"""Share of the observations below which a solve is refused. Between the clips of `benchmarks.solving`,
where a thing of 30 % of the picture that goes its own way leaves 0.58 to 0.63 and the solve is right, and
0.47 to 0.55 of shifted ones."""
MIN_GROWTH = 1.05
"""Ratio of the picture's scales over a clip below which it is not tested whether the lens zooms."""
MIN_ZOOM_GAIN = 1.1
"""Factor by which the score of a zoom that nobody announced must exceed that of one focal length."""
ZOOMED = "the clip looks as if its lens zooms; if it does not, set the focal length"
AT_ONCE = "at once"
"""A start without pairs of pictures."""


def reconstruct(
    tracks: Tracks, prior: FocalPrior, record: Record, may_stay: bool, has_subjects: bool
) -> Solved:
    """Return cameras and points of a clip from its tracks, normalised, and their figures.

    Args:
        tracks: Those of the clip.
        prior: Prior of the focal length.
        record: Takes the attempts.
        may_stay: True if depth is known from elsewhere: the turns of a camera that stays in its place are
            then enough.
        has_subjects: True if the clip's subjects were left out. They have distances without parallax, too.

    Raises:
        UserError: The clip has no solution; the message has the reason.
    """
    estimates, notes, parallax = has_subjects and not may_stay, (LEFT_OUT,) * has_subjects, 0.0
    try:
        parallax = check_motion(tracks)
        if parallax >= TOLD_PARALLAX or not (may_stay or has_subjects):
            result, figures = _moving(tracks, prior, parallax, record)
            record.add("moving", explained=figures.explained)
            if figures.weak_depth is None or not estimates:
                return result, replace(figures, notes=(*figures.notes, *notes))
    except UserError as error:
        # A steadied or bent picture may be explained by no camera, and yet show hardly any depth; subjects
        # may leave too few features for a test.
        stays = isinstance(error, StaysError) and (may_stay or has_subjects)
        if not stays and not (estimates and parallax < DOUBTFUL_PARALLAX):
            raise
        record.add("moving", refusal=str(error))
    made, sigma = turned(tracks, prior.start(tracks), prior.sigma)
    share, source = solution.explained(made), "clip" if sigma < prior.sigma else prior.source
    result = _collected(made, "too little of this clip is static; choose another range of frames")
    record.add("staying", explained=share)
    figures = Figures(STAYS, source, sigma, explained=share, notes=notes, depth_estimated=estimates)
    return normalise(result), figures


def _collected(made: Solution, refusal: str) -> Reconstruction:
    """The cameras and points of a solution; UserError, which is `refusal`, for too few."""
    result = solution.collect(made)
    if len(result.images) < 2 or len(result.points) < MIN_POINTS:
        raise UserError(refusal)
    return result


def _moving(tracks: Tracks, prior: FocalPrior, parallax: float, record: Record) -> Solved:
    """A camera that leaves its place, with a `parallax` in pixels of a 1,000-pixel frame."""
    keys = keyframes(tracks)
    found, ratio = _Keyframes(keys, prior, parallax, record).zoom_or_not(tracks)
    best, lens = found.solution, found.lens
    depth = _depth(best)
    weak, sigma = None, found.focal_sigma
    if depth is not None and depth.uncertainty >= WEAK:
        # A lens that is taken for depth is taken for a focal length, too.
        weak, sigma = depth.uncertainty, max(sigma, prior.sigma)
    refuse_shifted(best, keys)
    if ratio is not None:
        self_calibration.refine_zoom(best, tracks, ratio)
    elif lens is None:
        # After the tests and claims: a tight fit to a part hides a zoom, and makes a bent scene look sure.
        self_calibration.refine_focal_length(best, prior.start(tracks), prior.sigma, PASSES)
        solution.triangulate(best)
        solution.drop_bad(best)
    solution.register_frames(best)
    for step in range(2):
        progress("Adjusting", step, 2)
        if lens is not None:
            lens.take_out(best)
        solution.triangulate(best)
        solution.drop_bad(best)
        adjust(best)
    solution.drop_bad(best)
    solution.drop_shallow(best)
    explained = solution.explained(best)
    if explained < MIN_EXPLAINED:
        raise UserError(
            f"only {100 * explained:.0f}% of the tracked points fit a static scene: too much moves on"
            " its own, or the pictures were stabilized or warped afterwards; choose another range"
            " of frames, or solve the clip as it was filmed",
            Remedy.FRAMES,
        )
    result = _collected(best, "too few points could be placed in 3D; film with more sideways movement")
    result = normalise(result if lens is None else lens.recording(result))
    source = "clip" if found.focal_sigma < prior.sigma / 2**0.5 else prior.source
    return result, Figures(
        AT_ONCE if found.start == AT_ONCE else "pairs", source, sigma, explained=explained,
        notes=(ZOOMED,) * (ratio is not None and not prior.zooms), depth_evidence=depth, weak_depth=weak,
        lens=report_of(lens, result.cameras[0].fx) if ratio is None else None,
    )  # fmt: skip


def _depth(made: Solution) -> DepthEvidence | None:
    """The clip's depth; StaysError if a turning camera explains it as well."""
    depth = depth_evidence(made)
    if depth is not None and depth.gain <= 0:
        raise only_turns(
            f"{depth.parallax:.2f} of 1000 px are beyond what any lens shows that turns, with"
            f" {depth.noise:.2f} of noise, GRIC {depth.gain:.2f}"
        )
    return depth


@dataclass(frozen=True)
class _Found:
    """A solution of the keyframes from one start."""

    solution: Solution
    start: str
    focal_sigma: float
    explained: float
    """Share of the keyframes registered times the share of their observations that take part."""
    score: float
    """Share of the keyframes' observations that is explained, by closeness; 1 is all."""
    lens: Lens | None = None
    """The lens that was removed from the tracks."""


@dataclass(frozen=True)
class _Keyframes:
    """A clip's keyframes before they are solved."""

    keys: list[int]
    """Indices of the clip's frames."""
    prior: FocalPrior
    parallax: float
    """Pixels of a 1,000-pixel frame that no rotation explains."""
    record: Record

    def zoom_or_not(self, tracks: Tracks) -> tuple[_Found, Floats | None]:
        """Solve the keyframes; also returns the zoom (F,), if the lens zooms."""
        found = None if self.prior.zooms else self._best(tracks)
        if found is None or (self.prior.sigma > 0 and found.explained < EXPLAINED):
            ratio = self_calibration.zoom_ratios(tracks)
            if found is None or ratio.max() >= MIN_GROWTH * ratio.min():
                other = self._best(self_calibration.zoomed(tracks, ratio), "zoom")
                if found is None or other.score >= MIN_ZOOM_GAIN * found.score:
                    return other, ratio
        assert found is not None
        return found, None

    def _best(self, tracks: Tracks, *zoom: str) -> _Found:
        """The best of all starts, without its lens if no `zoom` was removed from the tracks; or UserError."""
        found: list[_Found] = []
        for start, made in self._starts(tracks, found):
            progress("Settling the focal length", 0, 1)
            judged = None if made is None else self._judged(made, start)
            self._note(judged, *zoom, start)
            found += [judged] if judged is not None else []
            if found and found[-1].explained >= EXPLAINED:
                break
        best = max(found, key=lambda each: each.score, default=None)
        if best is not None and not zoom:
            best = self._with_lens(best)
        # Distortion may be taken for depth, a different one in each half.
        if self.parallax < DOUBTFUL_PARALLAX and (
            best is None or self_calibration.halves_disagree(best.solution)
        ):
            raise only_turns(
                f"{self.parallax:.2f} of 1000 px are not explained by turning, and do not agree on depth"
            )
        if best is None:
            raise UserError(
                "no camera path explains this clip: too little parallax, or too much moves on its own;"
                " choose another range of frames, or film with more sideways movement",
                Remedy.FRAMES,
            )
        return best

    def _starts(self, tracks: Tracks, found: list[_Found]) -> Iterator[tuple[str, Solution | None]]:
        """Starts and their solutions, the cheapest first; `found` holds those before that were good."""
        start = self.prior.start(tracks)
        if self.parallax >= MIN_PARALLAX:
            yield "pairs", self._by_pairs(tracks, start)
            if found and found[0].explained > MIN_FOLLOWED:
                # It may have followed a moving object: its tracks are removed, and the rest tried.
                rest = np.isnan(found[0].solution.xyz[tracks.track, 0])
                yield "rest of the pairs", self._by_pairs(tracks.only(rest), start, tracks)
                if self.prior.sigma > 0:
                    # Or it began with too short a lens and holds a flat background for all there is.
                    yield "longer focal length", self._by_pairs(tracks, LONGER_FOCAL * start)
        yield AT_ONCE, self._at_once(tracks, start)

    def _note(self, found: _Found | None, *step: str) -> None:
        """Put a step into the record."""
        explained, score = (None, None) if found is None else (found.explained, found.score)
        self.record.add(*step, explained=explained, score=score, refusal="no cameras" * (found is None))

    def _with_lens(self, found: _Found) -> _Found:
        """Remove the lens that the keyframes show from the tracks."""
        progress("Looking for a lens", 0, 1)
        made = found.solution
        told = find_lens(made, self.prior.start(made.tracks), self.prior.sigma)
        if told is not None:
            found = self._explained(told.solution, found.start, told.focal_sigma, told.lens)
        self._note(found, "no lens" if told is None else "lens")
        return found

    def _explained(self, made: Solution, start: str, sigma: float, lens: Lens | None = None) -> _Found:
        """A solution with its share of the observations."""
        posed = float(np.isfinite(made.translation[self.keys, 0]).mean())
        explained = solution.explained(made) * posed
        return _Found(made, start, sigma, explained, solution.score(made, self.keys), lens)

    def _judged(self, made: Solution, start: str) -> _Found | None:
        """A solution with its focal length refined, and its explained share; None without good points."""
        solution.triangulate(made)
        solution.drop_bad(made)
        if np.count_nonzero(np.isfinite(made.xyz[:, 0])) < MIN_POINTS:
            return None
        focal, known = self.prior.start(made.tracks), self.prior.sigma
        sigma = self_calibration.refine_focal_length(made, focal, known)
        solution.triangulate(made)
        solution.drop_bad(made)
        return self._explained(made, start, sigma)

    def _by_pairs(self, tracks: Tracks, focal: float, whole: Tracks | None = None) -> Solution | None:
        """COLMAP's incremental mapping; the solution is of the tracks `whole` if these are part of them."""
        features = keyframe_features(tracks, self.keys)
        model = map_keyframes(tracks, features, focal)
        if model is None or model.num_points3D() < MIN_POINTS:
            return None
        made = solution.empty(whole or tracks, focal)
        support = np.zeros(tracks.count, int)
        for number in model.reg_image_ids():
            image, index = model.images[number], self.keys[number - 1]
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

    def _at_once(self, tracks: Tracks, focal: float) -> Solution | None:
        """One adjustment of all keyframes from nothing; None where too few tracks span them."""
        span = small_motion.long_tracks(tracks, self.keys)
        if len(span.tracks) < 4 * MIN_POINTS:
            return None
        placed = small_motion.general_motion(span, small_motion.rotation_only(span, focal).bundle)
        made = solution.empty(tracks, focal)
        made.rotation[self.keys] = placed.bundle.rotation
        made.translation[self.keys] = placed.bundle.translation
        made.xyz[span.tracks] = placed.bundle.world
        return made
