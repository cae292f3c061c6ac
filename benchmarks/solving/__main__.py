"""Structure from motion against the truth: trackers over motions, focal length unknown and known.

`python -m benchmarks.solving` films what is not filmed yet, solves one clip after the other, and prints a
table; rows whose inputs have not changed are kept, so that a run resumes where it was stopped.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import re
import resource
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Reconstruction
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.report import UNSURE_DEPTH
from addon.core.sfm.workspace import load_solve
from addon.render.views.quiet import quiet
from sample_scenes import staging, truth

from .. import store
from .ground_truth import Figures, Floats, Mask, Truth, measure
from .scenes import MOTIONS, Motion
from .trackers import NAMES as TRACKERS

RESULTS = Path(__file__).parents[1] / "results"
CODE = (*store.SOLVER, "benchmarks/solving")
"""What a row may depend on."""
FOCALS = ("unknown", "known")
FILM_SAMPLES = 8
DEPTH_STEP = 4
"""There is a depth map of every so many frames, and of the last."""
TOO_LONG = 900.0
"""Seconds after which a solve is ended."""
LEAST_REGISTERED = 0.98
MOST_LENGTHS = {"known": 2.0, "unknown": 5.0}
"""Per cent of error of length ratios."""
MOST_DISC = 5.0
"""Per cent of the largest disc by which discs may be off where a solve says that depth is hardly
observable."""
MOST_ON_MOVING_OBJECT = 0.05
BROKEN = "solving failed|ended with status|took longer"
"""In the message of a solve that came to nothing by itself."""
COVERAGE = 2.0
"""Standard deviations within which the true focal length must lie."""


class Clip:
    """A motion on film, and what is true of it. Films and renders what is missing."""

    def __init__(self, motion: Motion) -> None:
        self.motion = motion

    @cached_property
    def key(self) -> str:
        code = store.sources("sample_scenes/staging.py", "sample_scenes/truth.py")
        motion = self.motion
        lens = () if motion.lens is None else (motion.lens, store.sources("benchmarks/solving/real_lens.py"))
        return store.digest(motion.stage, motion.focals, code, bpy.app.version_string, FILM_SAMPLES, *lens)

    @property
    def folder(self) -> Path:
        return store.FOLDER / "motions" / f"{self.motion.name}-{self.key}"

    @cached_property
    def scene(self) -> bpy.types.Scene:
        bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
        scene, lens = staging.build(self.motion.stage), "lens"
        data = scene.camera.data
        for frame, focal in enumerate(self.motion.focals, start=1):
            data.lens = focal * data.sensor_width / self.motion.cameras.width
            data.keyframe_insert(lens, frame=frame)
        return scene

    def film(self) -> Path:
        """The folder of the whole clip."""
        before: truth.Picture | None = None
        for frame in range(1, len(self.motion.cameras) + 1):
            path = self.folder / "clip" / f"frame_{frame:04d}.png"
            if path.exists():
                continue
            if before is None or not self._stands_still(frame):
                with quiet(1):
                    # Every frame has a seed of its own: noise that stays in place would be tracked.
                    before = truth.pinhole(self.scene, frame, FILM_SAMPLES, seed=frame)
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_suffix(".part")
            picture = truth.recorded(self._through_lens(before, frame), frame)
            part.write_bytes(cv2.imencode(".png", picture[..., ::-1])[1].tobytes())
            part.rename(path)
        return self.folder / "clip"

    def _through_lens(self, picture: NDArray[np.float32], frame: int) -> NDArray[np.float32]:
        motion = self.motion
        if motion.lens is None:
            return picture
        return motion.lens.recorded(picture, frame, motion.cameras, float(motion.focals[frame - 1]))

    def as_pinhole(self, shot: Reconstruction) -> Reconstruction:
        """The solve with its observations where the stage's pinhole sees them, which the truth is of."""
        motion, lens = self.motion, self.motion.lens
        if lens is None:
            return shot
        images = tuple(
            replace(i, xy=lens.ideal(i.xy, i.frame, motion.cameras, float(motion.focals[i.frame - 1])))
            for i in shot.images
        )
        return replace(shot, images=images)

    def _stands_still(self, frame: int) -> bool:
        cameras, index = self.motion.cameras, frame - 1
        poses = np.concatenate([cameras.rotation.reshape(-1, 9), cameras.translation], axis=1)
        return index > 0 and bool((poses[index] == poses[index - 1]).all())

    @cached_property
    def truth(self) -> Truth:
        stage, last = self.motion.stage, len(self.motion.cameras)
        moving_objects = [i for i, thing in enumerate(stage.things) if thing.moves]
        depth: dict[int, Floats] = {}
        moves: dict[int, Mask] = {}
        for frame in sorted({*range(1, last + 1, DEPTH_STEP), last}):
            stored = store.kept(f"motions/{self.folder.name}/geometry", f"{frame:04d}", self._geometry(frame))
            depth[frame] = stored[0].astype(np.float64)
            moves[frame] = np.isin(stored[1], moving_objects)
        return Truth(self.motion.cameras, self.motion.focals, depth, moves)

    def _geometry(self, frame: int) -> Callable[[], NDArray[np.float32]]:
        def make() -> NDArray[np.float32]:
            found = truth.geometry(self.scene, frame)
            return np.stack([found.depth, found.thing]).astype(np.float32)

        return make


@dataclass(frozen=True)
class Row:
    """One solve."""

    motion: str
    tracker: str
    focal: str
    inputs: str
    """Changes with everything that the solve depends on."""
    judged: str
    """Changes with how it is measured."""
    verdict: str
    """"right", or what is wrong."""
    message: str = ""
    """Of the refusal."""
    figures: dict[str, float] = field(default_factory=dict)
    claims: dict[str, Any] = field(default_factory=dict)
    """The solve's own report."""
    cpu_s: float = 0.0
    """Of the worker, both threads."""
    wall_s: float = 0.0
    measured: str = ""
    """Commit and date."""

    @property
    def key(self) -> tuple[str, str, str]:
        return self.motion, self.tracker, self.focal


type Rows = dict[tuple[str, str, str], Row]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", nargs="*", default=[], choices=list(MOTIONS), help="only these")
    parser.add_argument("--trackers", nargs="*", default=[], choices=TRACKERS, help="only these")
    parser.add_argument("--focal", choices=FOCALS, help="only with the focal length unknown, or known")
    parser.add_argument("--film", action="store_true", help="film, solve nothing")
    parser.add_argument("--report", action="store_true", help="write the table again, solve nothing")
    arguments = parser.parse_args()
    rows = load()
    focals = [arguments.focal] if arguments.focal else list(FOCALS)
    for name in () if arguments.report else arguments.motions or MOTIONS:
        clip = Clip(MOTIONS[name]())
        clip.film()
        if arguments.film:
            assert clip.truth
            continue
        for tracker in arguments.trackers or TRACKERS:
            for focal in focals:
                run(clip, tracker, focal, rows)
    if arguments.film:
        return
    part = arguments.report or arguments.motions or arguments.trackers or arguments.focal
    code = "" if part else today()
    save(rows, code)
    text = table(list(rows.values()), code)
    (RESULTS / "motions.md").write_text(text)
    print(text)


def run(clip: Clip, tracker: str, focal: str, rows: Rows) -> None:
    """Solve and measure; what is there and whose inputs are what they were is kept."""
    motion = clip.motion
    inputs = store.digest(clip.key, store.sources(*store.SOLVER), tracker, focal)
    judge = store.sources("benchmarks/solving/ground_truth.py", "benchmarks/solving/__main__.py")
    judged = store.digest(judge, motion.refusal, motion.optional)
    old = rows.get((motion.name, tracker, focal))
    if old is not None and (old.inputs, old.judged) == (inputs, judged):
        return
    work = clip.folder / f"solve-{tracker}-{focal}-{inputs}"
    if old is None or old.inputs != inputs or not (old.message or work.exists()):
        for stale in clip.folder.glob(f"solve-{tracker}-{focal}-*"):
            shutil.rmtree(stale)
        # Of a zoom it is known that it is one.
        zooms = focal == "known" and not motion.has_one_focal
        given = float(motion.focals[0]) if focal == "known" and not zooms else None
        began, spent = time.perf_counter(), _children_seconds()
        message = solve(clip.film(), work, given, tracker, zooms)
        cost = round(_children_seconds() - spent, 1), round(time.perf_counter() - began, 1)
    else:
        message, cost = old.message, (old.cpu_s, old.wall_s)
    found = None if message else load_solve(work)
    figures = None if found is None else measure(clip.as_pinhole(found.reconstruction), clip.truth)
    quality = None if found is None else found.quality
    measured = ("depth_sigma", "reprojection_error")
    claims = (
        {} if found is None else found.figures.as_dict() | {name: getattr(quality, name) for name in measured}
    )
    row = Row(
        motion.name, tracker, focal, inputs, judged, verdict(motion, focal, message, figures, claims),
        message, {} if figures is None else asdict(figures), claims, *cost, store.commit(),
    )  # fmt: skip
    rows[row.key] = row
    save(rows)
    print(line(row), flush=True)


class _Solve(SolveProcess):
    """A solve by one of the trackers that are compared."""

    def __init__(self, clip: Path, work: Path, focal: float | None, tracker: str, zooms: bool) -> None:
        self._tracker = tracker
        super().__init__(clip, work, focal=focal, zooms=zooms)

    def _command(self) -> list[str]:
        return [*super()._command()[:-1], "benchmarks.solving.trackers", self._tracker]


def solve(clip: Path, work: Path, focal: float | None, tracker: str, zooms: bool) -> str:
    """Solve in the worker process into the folder `work`; empty, or why there is no solve."""
    process = _Solve(clip, work, focal, tracker, zooms)
    began = time.perf_counter()
    try:
        while not process.finished:
            process.poll()
            time.sleep(0.05)
            if time.perf_counter() - began > TOO_LONG:
                return f"the solve took longer than {TOO_LONG:g} s"
    except UserError as error:
        return str(error)
    finally:
        process.cancel()
    return ""


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def verdict(motion: Motion, focal: str, message: str, figures: Figures | None, claims: dict[str, Any]) -> str:
    """What is wrong with a solve, or "right": a refusal with the right name where there is no solution."""
    if figures is None:
        if re.search(BROKEN, message):
            return "broken"
        if not motion.refusal:
            return "refused"
        return "right" if re.search(motion.refusal, message, re.IGNORECASE) else "wrong words"
    if motion.refusal and not motion.optional:
        return "not refused"
    wrong = []
    if figures.registered < LEAST_REGISTERED:
        wrong.append("frames")
    # Where the focal length was only assumed, and that is said, lengths along the view may be off by as much;
    # where depths are uncertain, and that is said, by two standard deviations.
    assumed = abs(figures.focal) if focal == "unknown" and claims["focal_from"] != "clip" else 0.0
    unsure = 200 * claims["depth_sigma"] if claims["depth_sigma"] > UNSURE_DEPTH else 0.0
    if claims.get("weak_depth"):
        # Lengths are not known, and that is said; how far discs are off is left.
        if not figures.disc <= MOST_DISC:
            wrong.append("discs")
    elif not figures.lengths <= MOST_LENGTHS[focal] + assumed + unsure:
        wrong.append("lengths")
    if covers(figures, claims) is False:
        wrong.append("uncertainty")
    if figures.on_moving_object > MOST_ON_MOVING_OBJECT:
        wrong.append("on moving object")
    return ", ".join(wrong) or "right"


def covers(figures: Figures, claims: dict[str, Any]) -> bool | None:
    """Whether the found focal length's own uncertainty has room for its error; None where it found none."""
    if claims["focal_from"] != "clip" or claims["focal_sigma"] is None:
        return None
    return abs(figures.focal) <= COVERAGE * 100 * float(claims["focal_sigma"])


# Reporting

COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("frames %", lambda r: f"{100 * r.figures['registered']:.0f}"),
    ("points", lambda r: f"{r.figures['points_median']:.0f} / {r.figures['points_least']:.0f}"),
    ("grid %", lambda r: f"{100 * r.figures['grid']:.0f}"),
    ("rotation deg", lambda r: f"{r.figures['rotation_median']:.3f} / {r.figures['rotation_max']:.3f}"),
    (
        "place % path / depth",
        lambda r: f"{r.figures['position_path']:.2f} / {r.figures['position_depth']:.3f}",
    ),
    ("focal %", lambda r: f"{r.figures['focal']:+.2f}"),
    ("claimed", lambda r: _claimed(r)),
    ("k1 / readout", lambda r: _lens(r.claims)),
    ("lengths % (floor)", lambda r: f"{r.figures['lengths']:.2f} ({r.figures['lengths_floor']:.2f})"),
    ("stretch %", lambda r: f"{r.figures['stretch']:+.2f}"),
    ("1/z % med / 90", lambda r: f"{r.figures['inverse_depth']:.2f} / {r.figures['inverse_depth_90']:.2f}"),
    ("disc %", lambda r: f"{r.figures['disc']:.2f}"),
    ("track px", lambda r: f"{r.figures['track_px']:.2f}"),
    ("reprojection px", lambda r: f"{r.claims['reprojection_error']:.2f}"),
    ("GRIC", lambda r: f"{gain_of(r.message, r.claims):+.2f}".replace("+nan", "")),
    ("parallax / noise / misfit", lambda r: _parallax(r.claims)),
    ("on moving object %", lambda r: f"{100 * r.figures['on_moving_object']:.1f}"),
)
LEGEND = """
- *points*: median / least of a frame. *grid*: share of an 8x6 grid that has points, mean over the frames.
- *rotation*: median / largest error. *place*: RMS error of the camera centres after the best similarity, over
  the extent of the true path / over the median depth.
- *claimed*: what the solve says of its focal length, one standard deviation; x where the true one is over two
  away. "held": it was only assumed;
  in brackets what it was found to within.
- *k1 / readout*: what it found of the lens and of the shutter, in frames; 0 is held. `scenes.py` has
  the truth.
- *lengths*: median |log| of how far ratios of a length along the view to one across it are off, and in
  brackets what the same tracks give with the true cameras. *stretch*: the median with its sign, by how much
  lengths along the view are too long on the whole.
- *1/z*: relative error of inverse depth after the best scale, median / 90th percentile. *disc*: its median
  over the range of inverse depth in the clip, the error of a blur disc over the largest disc. Where a solve
  says that the camera hardly left its place, it is judged by this, else by lengths.
- *GRIC*: by how much Torr's criterion prefers a camera that moves to one that turns, both with any lens;
  below 0 a clip is refused. *parallax*: pixels of a frame 1,000 pixels long that no lens that turns explains,
  at the 90th percentile of the tracks; *noise*: what a camera that moves leaves; *misfit*: what the solve
  leaves.
- *track*: distance of the observations from where the true points are seen. CPU seconds are the worker's.
"""


def today() -> str:
    """Digest of the code as it is."""
    return store.digest(store.sources(*CODE))


def table(rows: list[Row], code: str = "") -> str:
    """All rows as Markdown, those of a motion together; `code` as of `save`."""
    names = list(MOTIONS)
    rows = sorted(rows, key=lambda r: (names.index(r.motion), r.tracker, r.focal == "known"))
    heads = ["motion", "tracker", "focal", "verdict", *(head for head, _ in COLUMNS), "CPU s", "wall s"]
    lines = ["# Solving", "", "| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in rows:
        cells = (
            [cell(row) for _, cell in COLUMNS] if row.figures else [row.message, *[""] * (len(COLUMNS) - 1)]
        )
        cost = [f"{row.cpu_s:.0f}", f"{row.wall_s:.0f}"]
        shown = row.verdict if row.verdict == "right" else f"**{row.verdict}**"
        lines.append("| " + " | ".join([row.motion, row.tracker, row.focal, shown, *cells, *cost]) + " |")
    right = sum(row.verdict == "right" for row in rows)
    when = store.measured_at((row.measured for row in rows), code, today())
    return "\n".join([*lines, "", f"{right} of {len(rows)} right. {when[0].upper()}{when[1:]}.", LEGEND])


def line(row: Row) -> str:
    """One row on one line, for watching a run."""
    name = f"{row.motion} {row.tracker} {row.focal}".ljust(28) + row.verdict.ljust(20)
    if not row.figures:
        return f"{name} {row.message} ({row.cpu_s:.0f} s)"
    parts = [f"{head} {cell(row)}" for head, cell in COLUMNS]
    return f"{name} {'; '.join(parts)} ({row.cpu_s:.0f} CPU s)"


def gain_of(message: str, claims: dict[str, Any]) -> float:
    """`Told.gain` by the message of a refusal or the report of a solve; NaN where it was not asked."""
    if claims:
        evidence = claims.get("depth_evidence")
        return float(evidence["gain"]) if evidence else float("nan")
    found = re.search(r"GRIC (-?[\d.]+)\)", message)
    return float(found[1]) if found else float("nan")


def _lens(claims: dict[str, Any]) -> str:
    """The first radial term and the readout of the height that a solve found."""
    if "readout" not in claims:
        return ""
    k1 = claims["distortion"]["terms"][0] if claims["distortion"] else 0.0
    return f"{k1:.4g} / {claims['readout'][1]:.4g}"


def _parallax(claims: dict[str, Any]) -> str:
    evidence = claims.get("depth_evidence")
    return " / ".join(f"{evidence[k]:.2f}" for k in ("parallax", "noise", "misfit")) if evidence else ""


def _claimed(row: Row) -> str:
    sigma = row.claims["focal_sigma"]
    spread = "?" if sigma is None else f"{100 * sigma:.2f}"
    if row.focal == "known":
        return "given"
    if row.claims["focal_from"] != "clip":
        return f"held ({spread})"
    outside = abs(row.figures["focal"]) > COVERAGE * 100 * (sigma or 0)
    return f"±{spread}{' x' if outside else ''}"


def load() -> Rows:
    with contextlib.suppress(FileNotFoundError):
        rows = [Row(**each) for each in json.loads((RESULTS / "motions.json").read_text())["rows"]]
        # JSON has no NaN.
        for row in rows:
            row.figures.update((name, np.nan) for name, value in row.figures.items() if value is None)
        return {row.key: row for row in rows if row.motion in MOTIONS}
    return {}


def save(rows: Rows, code: str = "") -> None:
    """Write the results file; `code` is the digest with which all rows are up to date, if they are."""
    RESULTS.mkdir(exist_ok=True)
    part = RESULTS / "motions.part"
    stored = [asdict(rows[key]) for key in sorted(rows)]
    for row in stored:
        row["figures"] = {
            name: value if np.isfinite(value) else None for name, value in row["figures"].items()
        }
    part.write_text(json.dumps({"code": code, "rows": stored}, indent=1, allow_nan=False) + "\n")
    part.rename(RESULTS / "motions.json")


if __name__ == "__main__":
    main()
