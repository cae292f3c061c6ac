"""The figures of a solve, in types and as in `solve.json`, and its quality with one sentence of advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..base.counting import common_step, ranges
from ..base.errors import Remedy, Words, with_words
from ..camera.reconstruction import Reconstruction
from ..media.clip import describe
from .adjustment.solution import mean_errors, observed, outermost_angles
from .calibration.stationary import DepthEvidence
from .steps import Attempt

STAYS = "turning"
"""The method of a solve whose camera stays in its place: depth is that of maps, or estimated."""
WEAK = 30
"""Feature points; a frame with fewer has a mesh that knows little."""
UNSURE_FOCAL = 0.02
"""Relative standard deviation of the focal length above which the report advises to set it."""
UNSURE_DEPTH = 0.015
"""Relative standard deviation of depth above which the report advises a small blur."""
UNTOLD_DEPTH = 0.5
"""Relative standard deviation of depth above which the clip shows hardly any."""
EXPLAINED = 0.8
"""Share of the tracked points that good cameras explain; with less, something moves by itself or went wrong:
the solver tries other ways, and the report warns."""
WRONG_ERROR, WRONG_SHARE = 4.0, 0.005
"""Mean reprojection error, in pixels and in long sides, above both of which a model does not belong to these
frames: COLMAP drops observations from 4 pixels on, and half a per cent is the limit for large pictures.
Chosen by inspection."""
SOURCES = {
    "clip": ("found from the clip", "found"),
    "given": ("given", "given as"),
    "metadata": ("from the clip's file", "said to be"),
    "guess": ("typical of a phone, assumed", "assumed to be"),
    "file": ("read", "read as"),
}
"""Words for `Report.focal_from`, behind a focal length and before one."""
NONE = (0.0, 0.0)
"""Terms of a lens that are held."""
NUMBERS = ("focal_sigma", "explained", "weak_depth", "fps", "seconds")
"""Figures that may be None."""


LEFT_OUT = "the clip's subjects were left out of the solve"
"""Note on a solve, and on a refusal."""


@dataclass(frozen=True)
class LensReport:
    """The lens and shutter of a solve that searched for them; held terms are 0."""

    distortion: tuple[float, float] = NONE
    """k1 and k2 of COLMAP's RADIAL and OpenCV's model."""
    distortion_sigma: tuple[float, float] = NONE
    """Their standard deviations."""
    corner: float = 0.0
    """Share by which the picture's corner is farther from its middle than a pinhole shows it."""
    readout: tuple[float, float] = NONE
    """As `Reconstruction.readout`."""
    readout_sigma: tuple[float, float] = NONE
    """Their standard deviations."""
    frame_ms: float | None = None
    """Milliseconds from a frame to the next; None if the clip has no rate."""

    def lines(self) -> list[str]:
        """Return lines for users."""
        return [f"distortion    {self._bends()}", f"shutter       {self._reads()}"]

    def _bends(self) -> str:
        if not any(self.distortion):
            return "not found, held at 0"
        terms = ", ".join(
            f"{name} {value:.4f} ±{sigma:.4f}" if value else f"{name} 0"
            for name, value, sigma in zip(("k1", "k2"), self.distortion, self.distortion_sigma, strict=True)
        )
        where = "nearer to" if self.corner < 0 else "farther from"
        return f"{terms}: the corner is {100 * abs(self.corner):.1f}% {where} the middle than a pinhole's"

    def _reads(self) -> str:
        if not any(self.readout):
            return "rolling shutter not found"
        axis = int(np.argmax(np.abs(self.readout)))
        share, sigma = self.readout[axis], self.readout_sigma[axis]
        first = ("left", "top")[axis] if share > 0 else ("right", "bottom")[axis]
        unit, called = (self.frame_ms, "ms") if self.frame_ms else (100.0, "% of a frame's time")
        return (
            f"{('columns', 'rows')[axis]} are read in {unit * abs(share):.1f} ±{unit * sigma:.1f} {called},"
            f" from the {first} on"
        )


@dataclass(frozen=True)
class Figures:
    """The figures of a solve, from the solver or from another program's file."""

    method: str = ""
    """Keyframes "pairs" or "at once", `STAYS`, "stills", or the format of a file."""
    focal_from: str = "file"
    """As `Report.focal_from`."""
    focal_sigma: float | None = None
    """Relative standard deviation of the focal length; None if it is unknown."""
    tracker: str = ""
    """"harris" or "sift"; empty of a file."""
    explained: float | None = None
    """As `Report.explained`."""
    notes: tuple[str, ...] = ()
    """Remarks for the user, one sentence each."""
    observed: bool = True
    """False where features are projections of points, so that they have no reprojection error."""
    depth_estimated: bool = False
    """True where the camera stays, and no depth maps are given."""
    depth_evidence: DepthEvidence | None = None
    """Depth of the clip; None if too few tracks could be compared, or none were."""
    weak_depth: float | None = None
    """Relative uncertainty of depth over its range where the clip has hardly any; else None."""
    lens: LensReport | None = None
    """None where no lens was looked for: in files, zooms, and of cameras that stay."""
    stills: bool = False
    """True for unordered photos."""
    fps: float | None = None
    """Frames a second; None without a rate."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions of the libraries that the solve depends on."""
    seconds: float | None = None
    """Seconds that the solve took."""
    attempts: tuple[Attempt, ...] = ()
    """Those that led to the solve, in their order; none of a file or an older version."""

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as `solve.json` has them."""
        held, lens = asdict(self), self.lens
        del held["lens"]
        if lens is not None:
            held |= {"readout": lens.readout, "readout_sigma": lens.readout_sigma}
            bend = {"terms": lens.distortion, "sigma": lens.distortion_sigma, "corner": lens.corner}
            held["distortion"] = bend if any(lens.distortion) else None
        return held

    @classmethod
    def read(cls, held: dict[str, Any]) -> Figures:
        """Return the figures of a `solve.json` of any version.

        Raises:
            KeyError, TypeError, ValueError: They are damaged.
        """
        given = {each.name: held[each.name] for each in fields(cls) if each.name in held}
        given |= {name: None if held.get(name) is None else float(held[name]) for name in NUMBERS}
        lens = None
        if "readout" in held:
            bend = held.get("distortion") or {"terms": NONE, "sigma": NONE, "corner": 0.0}
            lens = LensReport(
                _pair(bend["terms"]), _pair(bend["sigma"]), float(bend["corner"]), _pair(held["readout"]),
                _pair(held.get("readout_sigma", NONE)), 1000 / given["fps"] if given["fps"] else None,
            )  # fmt: skip
            if not max(map(abs, lens.readout)) <= 1:
                raise ValueError(f"its readout is {held['readout']}, not two shares of a frame")
        return cls(**given | {
            "notes": tuple(held.get("notes", ())),
            "depth_evidence": _read(DepthEvidence, held.get("depth_evidence")),
            "lens": lens,
            "attempts": tuple(filter(None, (_read(Attempt, each) for each in held.get("attempts", ())))),
        })  # fmt: skip


Solved = tuple[Reconstruction, Figures]
"""Cameras and points, and their figures."""


def _read[T](kind: type[T], held: dict[str, Any] | None) -> T | None:
    """A dataclass of those keys that it knows; None where one is missing, as another version may have it."""
    try:
        return kind(**{name: value for name, value in (held or {}).items() if name in kind.__annotations__})
    except TypeError:
        return None


def _pair(held: Sequence[float]) -> tuple[float, float]:
    return float(held[0]), float(held[1])


@dataclass(frozen=True)
class Report:
    """The quality of a solve. Pixels are the clip's own."""

    frames: int
    registered: int
    missing: list[int]
    """Frame numbers without a camera."""
    points: int
    points_per_frame: list[int]
    """Least, median, most."""
    added: int
    """0: a field of version 1.0, which counted points that a frame showed and did not track."""
    reprojection_error: float | None
    """None where nothing was measured: no observation is ahead of its camera, or the file stores none."""
    focal: list[float]
    """Least and greatest focal length."""
    focal_sigma: float | None
    """Relative standard deviation; None if it is unknown."""
    focal_from: str
    """"clip", "given", "metadata", "guess" or "file"."""
    lens: LensReport | None
    """None where no lens was looked for: in files, zooms, and of cameras that stay."""
    angle: list[float] | None
    """Degrees between the outermost rays of a point: quartiles. None where no point is seen twice."""
    distances: list[float]
    """Distances of points along the view, in the model's unit: 2nd percentile, median, 98th."""
    depth_sigma: float | None
    """Relative standard deviation of a typical depth; None without reprojection errors or angles."""
    explained: float | None
    """Share of the tracked observations that agree with a scene that stands still."""
    weak: list[int]
    """Frames with fewer than `WEAK` points."""
    notes: list[str]
    advice: str = ""
    """The most useful advice; empty if none is needed."""
    remedies: tuple[Remedy, ...] = ()
    """Settings that follow the advice."""

    def as_dict(self) -> dict[str, Any]:
        """Return all fields, as they are written to JSON."""
        return asdict(self)

    def advised(self, words: Words) -> str:
        """Return the advice in a line; empty without advice."""
        return f"advice: {with_words(self.advice, self.remedies, words)}" if self.advice else ""

    def text(self, words: Words) -> str:
        """Return the report for users, with an interface's names of settings."""
        sigma = "" if self.focal_sigma is None else f" ±{100 * self.focal_sigma:.1f}%"
        low, high = self.focal
        lens = f"{low:.0f} px" if high - low < 0.5 else f"{low:.0f} to {high:.0f} px"
        error = self.reprojection_error
        missed = "not measured: the model has no usable observations" if error is None else f"{error:.2f} px"
        lines = [
            f"frames        {self.registered} of {self.frames} registered"
            + (f"; without a camera: {ranges(self.missing)}" if self.missing else ""),
            f"points        {self.points}; per frame at least {self.points_per_frame[0]}, median"
            f" {self.points_per_frame[1]}, at most {self.points_per_frame[2]}",
            f"reprojection  {missed}",
            f"focal length  {lens}{sigma}, {SOURCES[self.focal_from][0]}",
            *(self.lens.lines() if self.lens is not None else []),
            f"parallax      {self._parallax()}",
            f"distances     {self.distances[0]:.4g} to {self.distances[2]:.4g}, {self.distances[1]:.4g} in"
            " the median, in the model's own unit",
        ]
        if self.explained is not None:
            lines.append(f"standing still  {100 * self.explained:.0f}% of what was tracked")
        if self.weak:
            lines.append(f"weak frames   {ranges(self.weak)} (fewer than {WEAK} points)")
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join([*lines, self.advised(words)] if self.advice else lines)

    def _parallax(self) -> str:
        unsure = "not known" if self.depth_sigma is None else f"uncertain by {100 * self.depth_sigma:.1f}%"
        if self.angle is None:
            return f"not measured: no point is seen in two frames; depth {unsure}"
        quartiles = ", ".join(f"{q:.2f}" for q in self.angle)
        return f"{quartiles} degrees (quartiles of the points); depth {unsure}"


def report(reconstruction: Reconstruction, frames: tuple[int, ...], figures: Figures) -> Report:
    """Return the report on a reconstruction.

    Args:
        reconstruction: The reconstruction.
        frames: Frames of the clip.
        figures: Those of the solver or reader.
    """
    counts = np.array([len(image.points) for image in reconstruction.images])
    seen = set(reconstruction.frames.tolist())
    missing = [frame for frame in frames if frame not in seen]
    focal = [reconstruction.intrinsics(image).fx for image in reconstruction.images]
    point, missed, rays = observed(reconstruction)
    angle = outermost_angles(rays, point, len(reconstruction.points))
    angle = angle[(reconstruction.views_per_point >= 2) & np.isfinite(angle)]
    errors = mean_errors(point, missed, len(reconstruction.points))
    is_measured = figures.observed and np.isfinite(errors).any()
    error = float(np.nanmean(errors)) if is_measured else None
    spread = None
    if error is not None and len(angle) and figures.method != STAYS:
        # More observations of a track do not help: they share its error.
        spread = error / float(np.median(focal)) / max(np.radians(float(np.median(angle))), 1e-9)
    # A pan's lens is taken for depth: reprojection errors do not show it.
    if figures.weak_depth is not None:
        spread = max(spread or 0.0, figures.weak_depth)
    weak = [image.frame for image in reconstruction.images if len(image.points) < WEAK]
    found = Report(
        len(frames), len(counts), missing, len(reconstruction.points),
        [int(counts.min()), int(np.median(counts)), int(counts.max())],
        0, error, [min(focal), max(focal)], figures.focal_sigma,
        figures.focal_from, figures.lens,
        [float(q) for q in np.percentile(angle, (25, 50, 75))] if len(angle) else None,
        _distances(reconstruction), spread, figures.explained, weak, list(figures.notes),
    )  # fmt: skip
    long_side = max(max(camera.width, camera.height) for camera in reconstruction.cameras)
    advice, remedies = _advice(found, list(frames), long_side, figures.depth_estimated)
    return replace(found, advice=advice, remedies=remedies)


def _advice(it: Report, frames: list[int], long_side: int, estimated: bool) -> tuple[str, tuple[Remedy, ...]]:
    """The one thing that would help most, and where to set it."""
    missed, missing, depth = it.reprojection_error, it.missing, it.depth_sigma
    if missed is not None and missed > max(WRONG_ERROR, WRONG_SHARE * long_side):
        return (
            f"renders will be wrong: these cameras miss the clip by {missed:.0f} px (another take or lens?)",
            (),
        )
    if it.explained is not None and it.explained < EXPLAINED:
        return "something moves: click it to focus on it", ()
    if estimated:
        # A clip that is solved for its people alone.
        text = "the background's distance is a guess; depth maps of the clip are more exact"
        return text, (Remedy.DEPTH_MAPS,)
    without = set(missing)
    places = [place for place, frame in enumerate(frames) if frame not in without]
    if common_step(places) > 1:
        return (
            f"only {describe([frames[place] for place in places])} has a camera; import a camera for each, or"
            " these frames alone",
            (Remedy.STEP,),
        )
    if missing:
        return (
            f"frame {missing[0]} has no camera and uses its neighbours'; leave it out"
            if len(missing) == 1
            else f"frames {ranges(missing)} have no camera and use their neighbours'; leave them out",
            (Remedy.FRAMES,),
        )
    if depth is not None and depth > UNTOLD_DEPTH:
        return "the clip shows hardly any depth: keep the blur small, or film with more sideways movement", ()
    if depth is not None and depth > UNSURE_DEPTH:
        return "depth is not exact: keep the blur small, or film with more sideways movement", ()
    if it.focal_sigma is not None and it.focal_sigma > UNSURE_FOCAL and it.focal_from != "given":
        return "distances are a guess (blur hardly depends on it); set the focal length", (Remedy.FOCAL,)
    if it.weak:
        which = f"frame {it.weak[0]} has" if len(it.weak) == 1 else f"frames {ranges(it.weak)} have"
        return f"{which} few points; focus may be less exact there", ()
    return "", ()


def _distances(reconstruction: Reconstruction) -> list[float]:
    """As `Report.distances`."""
    depths = np.concatenate(
        [image.to_camera(reconstruction.points.xyz[image.points])[:, 2] for image in reconstruction.images]
    )
    depths = depths[np.isfinite(depths) & (depths > 0)]
    return [float(q) for q in np.percentile(depths, (2, 50, 98))] if len(depths) else [0.0, 0.0, 0.0]
