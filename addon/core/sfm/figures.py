"""The figures of a solve beside its cameras and points: as types, and as `solve.json` keeps them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from ..camera.reconstruction import Reconstruction
from .calibration.stationary import DepthEvidence

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
class Attempt:
    """A hypothesis of a solve, or a step of one, and its verdict."""

    name: str
    """Tracks, start and lens, such as "corners, zoom, at once"."""
    seconds: float
    """CPU seconds since the attempt before."""
    explained: float | None = None
    """Share of the observations that it explains; None where it has no cameras."""
    score: float | None = None
    """As `adjustment.solution.score`; None where nothing is compared by it."""
    refusal: str = ""
    """Message of the error that ended it."""


class Record:
    """The attempts of a solve under way."""

    def __init__(self) -> None:
        self.attempts: list[Attempt] = []
        self.hypothesis = ""
        """Begins the names of the next attempts."""
        self._since = time.process_time()

    def add(
        self, *step: str, explained: float | None = None, score: float | None = None, refusal: str = ""
    ) -> None:
        """Add an attempt that ends now; arguments as of `Attempt`."""
        before, self._since = self._since, time.process_time()
        name = ", ".join(filter(None, (self.hypothesis, *step)))
        self.attempts.append(Attempt(name, round(self._since - before, 2), explained, score, refusal))


def table(attempts: Sequence[Attempt]) -> str:
    """Return attempts as lines for users."""
    if not attempts:
        return "attempts      no record: imported, solved from photos, or by an older version"
    width = max(len(each.name) for each in attempts)
    rows = [f"{'attempt':{width}}  CPU s  explained  score  verdict"]
    for each in attempts:
        explained = "" if each.explained is None else f"{100 * each.explained:.0f}%"
        score = "" if each.score is None else f"{each.score:.2f}"
        rows.append(
            f"{each.name:{width}}  {each.seconds:5.1f}  {explained:>9}  {score:>5}  {each.refusal}".rstrip()
        )
    return "\n".join(rows)


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
        evidence, lens = held.get("depth_evidence"), None
        if "readout" in held:
            bend = held.get("distortion") or {"terms": NONE, "sigma": NONE, "corner": 0.0}
            lens = LensReport(
                _pair(bend["terms"]), _pair(bend["sigma"]), float(bend["corner"]), _pair(held["readout"]),
                _pair(held["readout_sigma"]), 1000 / given["fps"] if given["fps"] else None,
            )  # fmt: skip
            if not max(map(abs, lens.readout)) <= 1:
                raise ValueError(f"its readout is {held['readout']}, not two shares of a frame")
        return cls(**given | {
            "notes": tuple(held.get("notes", ())),
            "depth_evidence": evidence and _read(DepthEvidence, evidence),
            "lens": lens,
            "attempts": tuple(_read(Attempt, each) for each in held.get("attempts", ())),
        })  # fmt: skip


Solved = tuple[Reconstruction, Figures]
"""Cameras and points, and their figures."""


def _read[T](kind: type[T], held: dict[str, Any]) -> T:
    """A dataclass without the keys that a later version has added."""
    return kind(**{name: held[name] for name in kind.__annotations__ if name in held})


def _pair(held: Sequence[float]) -> tuple[float, float]:
    return float(held[0]), float(held[1])
