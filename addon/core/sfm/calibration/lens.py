"""The lens and shutter of a clip, and their removal from its tracks.

Distortion, a focal length, a turn during readout and a scene's shape can be confused. Each term is kept only
if it is far larger than its covariance, if both halves of the clip agree on it, and if the focal length stays
determined beside it; else it is held at 0. Brown, "Close-range camera calibration", 1971; Forssen and
Ringaby, "Rectifying rolling shutter video from hand-held devices", 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import Floats, Ints
from ...camera.intrinsics import Intrinsics
from ...camera.reconstruction import Reconstruction, turning_speeds
from ..adjustment import solution
from ..adjustment.bundle import SIGMA, Bundle, Distortion, Observations
from ..adjustment.bundle_adjustment import Adjusted, adjust, stretched, turns
from ..adjustment.small_motion import select_observations
from ..adjustment.solution import Solution, resected
from ..report import LensReport
from ..tracking.tracks import Tracks
from .self_calibration import UNMODELLED, as_bundle, put_back

K1, K2, ACROSS, DOWN = 2, 3, 4, 5
"""Places in `Distortion.parameters`."""
PINHOLE = np.zeros(len(SIGMA))
"""Those of a camera that neither bends nor reads its picture bit by bit."""
# Chosen by inspection of clips with true lenses and of real ones where no line below gives a measurement
# (`make bench-solve`).
LONGEST, LONGEST_IN_FRAME = 800, 30
"""As of `self_calibration`, of the tracks that determine the lens."""
MIN_TRACKS = 60
"""Least tracks in each half of the clip; with fewer, neither distortion nor readout is estimated."""
MIN_KEYS = 12
"""Least keyframes, likewise."""
BLOCKS = 8
"""Parts of the clip whose errors are taken to be independent of each other's."""
SIGMAS = 2 * UNMODELLED
"""Standard deviations by which a term must differ from 0: two real ones."""
FOCAL_SIGMA = 0.05
"""Relative standard deviation of a free focal length, times `self_calibration.UNMODELLED`, from which
distortion cannot be separated from it: the clip of a real desk, its camera's path 1 to 4 % of the depth, has
0.08, and a focal length that diverges with k1."""
NEAR = 0.1
"""Relative distance from the focal length to begin with, past which the search begins there as well."""
MIN_SHARE = 0.4
"""Share of a term that each half of the clip must find by itself: 0.3 of a readout in one half of a
meadow (real data) and 1.6 in the other are none."""
MIN_FALL = 0.002
"""Share of the squared errors that what is found must explain."""
ROUNDS = 3
"""Most rounds of finding the lens again in tracks from which it was removed."""
SETTLED = 1e-3
"""Change of every parameter at which that is enough."""
KEYS = 60
"""Keyframes that are looked at, at most, at even steps; the others follow from their points."""


@dataclass(frozen=True)
class Lens:
    """A distortion and a readout, and the tracks as they were recorded with both."""

    parameters: Floats
    """(6,) as `Distortion.parameters`."""
    sigma: Floats
    """(6,) standard deviations; 0 of held terms."""
    recorded: Tracks
    """With the same observations in the same order as those it is taken out of."""

    @property
    def readout(self) -> tuple[float, float]:
        """As `Reconstruction.readout`."""
        return float(self.parameters[ACROSS]), float(self.parameters[DOWN])

    def intrinsics(self, focal: float) -> Intrinsics:
        """Return the camera of a focal length in pixels."""
        tracks, (k1, k2) = self.recorded, self.terms(self.parameters, focal)
        return Intrinsics(
            tracks.width, tracks.height, focal, focal, tracks.width / 2, tracks.height / 2, k1, k2
        )

    def terms(self, parameters: Floats, focal: float) -> tuple[float, float]:
        """Return k1 and k2 of the model OPENCV from parameters (6,), or from their deviations."""
        unit = focal / (np.hypot(self.recorded.width, self.recorded.height) / 2)
        return float(parameters[K1] * unit**2), float(parameters[K2] * unit**4)

    @property
    def corner(self) -> float:
        """Relative displacement of the picture's corner from a pinhole's picture; negative for barrels.

        It is not finite where a polynomial folds before the corner, which no lens does.
        """
        tracks = self.recorded
        unit = float(np.hypot(tracks.width, tracks.height)) / 2
        seen = self.intrinsics(unit).pinhole_pixels(np.array([[tracks.width, tracks.height]]))
        return float(unit / np.linalg.norm(seen - [tracks.width / 2, tracks.height / 2]) - 1)

    def straightened(self, focal: Floats, speed: Floats) -> Tracks:
        """Return the tracks of a pinhole with a global shutter, at the time of the frame's middle.

        Args:
            focal: (F,) in pixels.
            speed: (F, 3) as in `Distortion`.
        """
        tracks = self.recorded
        unit = float(np.hypot(tracks.width, tracks.height)) / 2
        middle = np.array([tracks.width, tracks.height]) / 2
        place = self.intrinsics(unit).pinhole_pixels(tracks.xy)
        # A track may leave the picture by a pixel, where a polynomial may end: it stays, and is a bad one.
        place = np.where(np.isfinite(place), place, tracks.xy) - middle
        when = (tracks.xy - middle) @ (self.parameters[ACROSS:] / (2 * middle))
        if when.any():
            length = focal[tracks.frame_index, None]
            turn = turns(-when[:, None] * speed[tracks.frame_index])
            rays = np.einsum("mij,mj->mi", turn, np.column_stack([place / length, np.ones(len(place))]))
            place = length * rays[:, :2] / rays[:, 2:]
        return replace(tracks, xy=place + middle)

    def recording(self, found: Reconstruction) -> Reconstruction:
        """Return a reconstruction by pinholes of the recorded places with the cameras that recorded them."""
        cameras = tuple(self.intrinsics(camera.fx) for camera in found.cameras)
        found = replace(found, cameras=cameras, readout=self.readout)
        point, missed, _ = solution.observed(found)
        error = solution.mean_errors(point, missed, len(found.points))
        return replace(found, points=replace(found.points, error=error))

    def take_out(self, made: Solution) -> None:
        """Give a solve the tracks without what this is, by how its registered frames turn."""
        posed = np.isfinite(made.translation[:, 0])
        speed = np.zeros((len(posed), 3))
        speed[posed] = turning_speeds(made.rotation[posed], np.array(made.tracks.frames)[posed])
        made.tracks = self.straightened(made.focal, speed)


def report_of(lens: Lens | None, focal: float) -> LensReport:
    """Return the report on a lens at a focal length in pixels; None is a search without a result."""
    if lens is None:
        return LensReport()
    sigma = float(lens.sigma[ACROSS]), float(lens.sigma[DOWN])
    if not lens.parameters[[K1, K2]].any():
        return LensReport(readout=lens.readout, readout_sigma=sigma)
    terms, terms_sigma = (lens.terms(each, focal) for each in (lens.parameters, lens.sigma))
    return LensReport(terms, terms_sigma, lens.corner, lens.readout, sigma)


@dataclass(frozen=True)
class Found:
    """A solve of tracks that a lens was taken out of."""

    solution: Solution
    lens: Lens
    focal_sigma: float
    """Relative standard deviation of the focal length, what was known before included."""


def find_lens(made: Solution, start: float, known: float) -> Found | None:
    """Find the lens and the shutter from a solve's keyframes; None without evidence.

    The focal length is refined beside them, as by `refine_focal_length` with `start` and `known`.
    """
    fit = _Fit.of(made, made.tracks, known > 0)
    enough = len(fit.posed) >= MIN_KEYS and len(fit.bundle.points) >= MIN_TRACKS
    found = fit.told(start) if enough else None
    if found is None:
        return None
    terms, adjusted = found
    trial = replace(
        made, focal=made.focal.copy(), rotation=made.rotation.copy(), translation=made.translation.copy(),
        xyz=made.xyz.copy(),
    )  # fmt: skip
    lens = fit.lens(adjusted, terms)
    for _ in range(ROUNDS):
        if not np.isfinite(lens.corner):
            return None
        fit.put(trial, adjusted, lens)
        fit = _Fit.of(trial, made.tracks, known > 0)
        adjusted = fit.adjusted(terms, lens.parameters)
        before, lens = lens, fit.lens(adjusted, terms)
        if np.abs(lens.parameters - before.parameters).max() < SETTLED:
            break
    sigma = fit.focal_sigma(adjusted)
    if known > 0:
        weight = known**2 / (known**2 + sigma**2) if np.isfinite(sigma) else 0.0
        wanted = np.exp((1 - weight) * np.log(start) + weight * np.log(adjusted.bundle.focal))
        fit = replace(fit, bundle=replace(adjusted.bundle, focal=wanted), free_focal=False)
        adjusted = fit.adjusted(terms, lens.parameters)
        lens = replace(lens, parameters=parameters_of(adjusted))
        sigma = float(1 / np.sqrt(1 / known**2 + 1 / sigma**2))
    if not np.isfinite(lens.corner):
        return None
    fit.put(trial, adjusted, lens)
    return Found(trial, lens, sigma)


@dataclass(frozen=True)
class _Fit:
    """Keyframes and the best of their points, and the places where they were recorded."""

    bundle: Bundle
    seen: Observations
    posed: Ints
    """(k,) frames."""
    kept: Ints
    """(p,) tracks."""
    speed: Floats
    """(F, 3) of all frames."""
    recorded: Tracks
    loss: float
    free_focal: bool

    @classmethod
    def of(cls, made: Solution, recorded: Tracks, free_focal: bool) -> _Fit:
        bundle, _, posed, kept = as_bundle(made, LONGEST, LONGEST_IN_FRAME)
        seen = select_observations(recorded, posed, kept, made.used)
        speed = turning_speeds(resected(made, kept)[0], np.array(recorded.frames))
        whole = cls(bundle, seen, posed, kept, speed, recorded, made.max_error / 2, free_focal)
        some = np.linspace(0, len(posed) - 1, min(len(posed), KEYS)).round().astype(np.int32)
        return whole if len(some) == len(posed) else whole._part(bundle, some)

    def adjusted(self, terms: Sequence[int], parameters: Floats = PINHOLE) -> Adjusted:
        """With some terms of the distortion free, which begin with `parameters` (6,)."""
        size = self.recorded.width, self.recorded.height
        free = np.isin(np.arange(len(SIGMA)), terms)
        lens = Distortion(size, self.speed[self.posed], parameters * free, free)
        start = replace(self.bundle, distortion=lens)
        return adjust(start, self.seen, self.loss, "common" if self.free_focal else "held")

    def put(self, made: Solution, found: Adjusted, lens: Lens) -> None:
        """Write an adjustment into a solve, with the lens removed from its tracks."""
        made.focal[:] = found.bundle.focal[0]
        made.tracks, made.recorded = lens.straightened(made.focal, self.speed), self.recorded.xy
        others = np.isfinite(made.translation[:, 0])
        others[self.posed] = False
        put_back(made, found.bundle, self.posed, self.kept)
        if others.any():
            made.translation[others] = np.nan
            rotation, translation = resected(made, self.kept)
            made.rotation[others], made.translation[others] = rotation[others], translation[others]
        solution.triangulate(made)
        solution.drop_bad(made)

    def sigmas(self, found: Adjusted) -> Floats:
        """Standard deviations (n,) of common parameters, with errors by track and by part (Cameron 2011)."""
        block = self.seen.frame * BLOCKS // len(self.posed)
        both = self.seen.point.astype(np.int64) * BLOCKS + block
        one, other, shared = (np.diag(found.covariance(unit)) for unit in (self.seen.point, block, both))
        # A difference of estimates may be too small by chance.
        return np.asarray(np.sqrt(np.maximum(one + other - shared, np.maximum(one, other))))

    def focal_sigma(self, found: Adjusted) -> float:
        """Return the relative standard deviation of the focal length, with unmodelled errors; 0 if held."""
        return UNMODELLED * float(self.sigmas(found)[0]) if self.free_focal else 0.0

    def lens(self, found: Adjusted, terms: Sequence[int]) -> Lens:
        """Return the lens of an adjustment."""
        sigma = UNMODELLED * self.sigmas(found)[-len(SIGMA) :]
        return Lens(parameters_of(found), sigma * np.isin(np.arange(len(SIGMA)), terms), self.recorded)

    def told(self, start: float) -> tuple[tuple[int, ...], Adjusted] | None:
        """Return the terms with evidence, and the adjustment with them, from a focal length near `start`."""
        terms: tuple[int, ...] = (K1, ACROSS, DOWN)
        least = (1 - MIN_FALL) * self.adjusted(()).cost
        found = self._best(start, terms)
        while terms and found.cost < least:
            kept = self._kept(found, terms)
            if kept == terms:
                break
            terms, found = kept, self._after(found, kept)
        if K1 in terms:
            both = self._after(found, (*terms, K2))
            if K2 in self._kept(both, (*terms, K2)):
                terms, found = (*terms, K2), both
        return (terms, found) if terms and found.cost < least and self._agrees(found, terms) else None

    def _best(self, start: float, terms: tuple[int, ...]) -> Adjusted:
        """Adjustment from the solve's focal length, or from `start` if distortion made that diverge."""
        found = self.adjusted(terms)
        away = float(np.log(start / found.bundle.focal[0]))
        if not self.free_focal or abs(away) < NEAR:
            return found
        there = replace(self, bundle=stretched(found.bundle, away)[0], free_focal=False)
        other = self._after(there.adjusted(terms, parameters_of(found)), terms)
        return min(found, other, key=lambda each: each.cost)

    def _after(self, found: Adjusted, terms: tuple[int, ...]) -> Adjusted:
        """Adjustment with some terms free, from one with others."""
        return replace(self, bundle=found.bundle).adjusted(terms, parameters_of(found))

    def _kept(self, found: Adjusted, terms: tuple[int, ...]) -> tuple[int, ...]:
        """Terms that differ significantly from 0; of two readouts only the surer one is kept."""
        sigma = self.sigmas(found)[-len(SIGMA) :]
        times = np.abs(parameters_of(found)) / np.maximum(sigma, 1e-12)
        kept = [term for term in terms if times[term] > SIGMAS]
        if self.free_focal and self.focal_sigma(found) > FOCAL_SIGMA:
            kept = [term for term in kept if term not in (K1, K2)]
        if ACROSS in kept and DOWN in kept:
            kept.remove(ACROSS if times[ACROSS] < times[DOWN] else DOWN)
        return tuple(kept)

    def _agrees(self, found: Adjusted, terms: tuple[int, ...]) -> bool:
        """Return whether both halves of the clip agree with the whole."""
        whole = _effects(found)
        for half in np.array_split(np.arange(len(self.posed), dtype=np.int32), 2):
            part = self._part(found.bundle, half)
            if len(part.bundle.points) < MIN_TRACKS:
                return False
            own = part.adjusted(terms, parameters_of(found))
            sigma = UNMODELLED * part.sigmas(own)[-len(SIGMA) :]
            spread = 2 * np.array([sigma[K1], sigma[ACROSS], sigma[DOWN]])
            alike = _effects(own) * np.sign(whole) >= MIN_SHARE * np.abs(whole)
            if not np.all(alike | (np.abs(_effects(own) - whole) <= spread)):
                return False
        return True

    def _part(self, whole: Bundle, frames: Ints) -> _Fit:
        """The same of some of the keyframes alone, from poses and points of `whole`."""
        seen = self.seen
        rows = np.isin(seen.frame, frames)
        views = np.bincount(seen.point[rows], minlength=len(self.kept))
        lasting = views >= 3
        rows &= lasting[seen.point]
        place, number = np.zeros(len(self.posed), np.int32), np.cumsum(lasting).astype(np.int32) - 1
        place[frames] = np.arange(len(frames))
        bundle = Bundle(
            whole.rotation[frames], whole.translation[frames], whole.points[lasting], whole.focal[frames]
        )
        seen = Observations(place[seen.frame[rows]], number[seen.point[rows]], seen.xy[rows])
        return replace(self, bundle=bundle, seen=seen, posed=self.posed[frames], kept=self.kept[lasting])


def parameters_of(found: Adjusted) -> Floats:
    """Return (6,) of the distortion; 0 of a pinhole."""
    lens = found.bundle.distortion
    return np.zeros(len(SIGMA)) if lens is None else lens.parameters


def _effects(found: Adjusted) -> Floats:
    """(3,) what the lens does in the corner, in half diagonals, and the readouts."""
    given = parameters_of(found)
    return np.array([given[K1] + given[K2], given[ACROSS], given[DOWN]])
